#pragma once

/// The pose that the parts of a body usually have which no landmark shows, wrists and fingers for example. In a single
/// frame outlines say little about them; what all frames say together, under the assumption that such a DoF has the
/// same value in each, is well determined.

#include <vector>

namespace doppel {

/// Values that stand in the place of the rest pose's.
struct SharedDofs {
  std::vector<int> dofs;       ///< which
  std::vector<double> values;  ///< of each
  double weight = 100.0;       ///< holds them there where they are unknown, per squared radian

  /// Replaces these DoFs of a pose. @param pose [D]
  void put_into(std::vector<double>& pose) const;
};

/// What holds each DoF to it, [D]: a usual one its own weight where that is more. Empty when nothing is held.
std::vector<double> prior_weights(const SharedDofs& shared, double prior_weight, std::size_t num_dofs);

}  // namespace doppel
