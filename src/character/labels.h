#pragma once

#include <array>
#include <string>

namespace doppel {

/// What the labels of the LIP human parser mean, and 20, what lies under a dress: `background`, `hat`,
/// `upper_clothes`...
constexpr int kNumLabels = 21;
const std::array<std::string, kNumLabels>& label_names();

}  // namespace doppel
