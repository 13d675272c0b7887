#pragma once

#include <Eigen/Core>
#include <string>

namespace doppel {

/// The rotation that takes a vertical axis, of length 1, to y: about x for z and -y, about z for x and -x.
Eigen::Matrix3d y_up_from_axis(const Eigen::Vector3d& up);

/// The axis among +-x, +-y, +-z that is nearest to a direction, and the cosine between them.
struct NearestAxis {
  Eigen::Vector3d axis = Eigen::Vector3d::UnitY();
  double cosine = 0.0;  ///< 0 for a direction of no length
};
NearestAxis nearest_axis(const Eigen::Vector3d& direction);

/// "z" or "-y".
std::string axis_name(const Eigen::Vector3d& axis);

}  // namespace doppel
