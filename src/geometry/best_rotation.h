#pragma once

#include <Eigen/Geometry>

namespace doppel {

/// The rotation R that best aligns the directions `from` with `to` (Kabsch): it minimises the sum of |R from_i -
/// to_i|^2 and ignores positions. The lengths of the columns are weights. Two directions that are not parallel
/// determine R.
/// @param from [3, n] @param to [3, n]
Eigen::Matrix3d best_rotation(const Eigen::Matrix3Xd& from, const Eigen::Matrix3Xd& to);

/// The rotation R with the largest trace of R^T `matrix`, which is also the nearest to it (Procrustes).
Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& matrix);

/// The smallest rotation that takes the direction `from` to `to`; both have any length but 0.
Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

}  // namespace doppel
