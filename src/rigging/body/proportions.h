#pragma once

#include <span>

#include "doppel/rigging/body/body_warp.h"

namespace doppel {

/// The factors of a body from the ratios of its measures to those of a reference body. Lengths, breadths of head, hands
/// and feet, and joints follow their measures exactly. Girths of the trunk become breadths and depths as in an ellipse:
/// breadth = girth^1.5 / depth^0.5 for factors near 1. Smooth.
/// @param measures, reference [P] above 0; hair and looseness are not used
BodyFactors proportional_factors(std::span<const double> measures, std::span<const double> reference);

/// @throws Error unless there are P finite values above 0, of hair and looseness at least 0
void check_measures(std::span<const double> measures);

}  // namespace doppel
