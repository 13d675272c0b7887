#include "doppel/geometry/lens_jacobian.h"

namespace doppel {

Eigen::Matrix2d lens_jacobian(const Camera& camera, const Eigen::Vector2d& plane) {
  if (!camera.has_distortion()) return Eigen::Matrix2d::Identity();
  const double step = 1e-6 * (1.0 + plane.norm());
  Eigen::Matrix2d jacobian;
  for (int axis = 0; axis < 2; ++axis) {
    const Eigen::Vector2d moved = step * Eigen::Vector2d::Unit(axis);
    jacobian.col(axis) = (camera.distorted(plane + moved) - camera.distorted(plane - moved)) / (2.0 * step);
  }
  return jacobian;
}

}  // namespace doppel
