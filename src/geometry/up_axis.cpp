#include "doppel/geometry/up_axis.h"

#include <Eigen/Geometry>
#include <cmath>

#include "doppel/geometry/best_rotation.h"

namespace doppel {

Eigen::Matrix3d y_up_from_axis(const Eigen::Vector3d& up) {
  // A half turn has no smallest rotation: about x, as for z.
  if (up.y() < -0.999) return Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX()).toRotationMatrix();
  return rotation_between(up, Eigen::Vector3d::UnitY()).toRotationMatrix();
}

NearestAxis nearest_axis(const Eigen::Vector3d& direction) {
  NearestAxis result;
  const double length = direction.norm();
  if (!(length > 0)) return result;
  Eigen::Index largest = 0;
  direction.cwiseAbs().maxCoeff(&largest);
  result.axis = (direction[largest] < 0 ? -1.0 : 1.0) * Eigen::Vector3d::Unit(largest);
  result.cosine = std::abs(direction[largest]) / length;
  return result;
}

std::string axis_name(const Eigen::Vector3d& axis) {
  Eigen::Index largest = 0;
  axis.cwiseAbs().maxCoeff(&largest);
  return std::string(axis[largest] < 0 ? "-" : "") + "xyz"[largest];
}

}  // namespace doppel
