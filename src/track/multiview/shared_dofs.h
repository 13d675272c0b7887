#pragma once

/// Shared DoFs: DoFs of parts without landmarks, for example wrists and fingers. The outlines of a single frame hardly
/// determine such a DoF. All frames together determine it well, when its value is the same in each.

#include <vector>

namespace doppel {

/// Values that replace those of the rest pose.
struct SharedDofs {
  std::vector<int> dofs;       ///< indices
  std::vector<double> values;  ///< [dofs]
  double weight = 100.0;       ///< of the prior on those that a fit has as unknowns, per squared radian

  /// Replaces these DoFs of a pose. @param pose [D]
  void put_into(std::vector<double>& pose) const;
};

/// The weight of the prior on each DoF, [D], per squared radian: for shared DoFs the larger of both weights. Empty when
/// all weights are 0.
std::vector<double> prior_weights(const SharedDofs& shared, double prior_weight, std::size_t num_dofs);

}  // namespace doppel
