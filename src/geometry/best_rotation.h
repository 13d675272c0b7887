#pragma once

#include <Eigen/Core>

namespace doppel {

/// The rotation R that best aligns the directions `from` with `to` (Kabsch): it minimises the sum of |R from_i -
/// to_i|^2 and ignores positions. The lengths of the columns are weights. Two directions that are not parallel
/// determine R.
/// @param from [3, n] @param to [3, n]
Eigen::Matrix3d best_rotation(const Eigen::Matrix3Xd& from, const Eigen::Matrix3Xd& to);

}  // namespace doppel
