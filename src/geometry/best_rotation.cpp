#include "doppel/geometry/best_rotation.h"

#include <Eigen/LU>

#include "doppel/geometry/decompositions.h"

namespace doppel {

Eigen::Matrix3d best_rotation(const Eigen::Matrix3Xd& from, const Eigen::Matrix3Xd& to) {
  return nearest_rotation(to * from.transpose());
}

Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& matrix) {
  const auto [U, values, V] = svd(matrix);
  Eigen::Vector3d signs = Eigen::Vector3d::Ones();
  signs.z() = (U * V.transpose()).determinant() < 0.0 ? -1.0 : 1.0;
  return U * signs.asDiagonal() * V.transpose();
}

Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  return Eigen::Quaterniond::FromTwoVectors(from, to);
}

}  // namespace doppel
