#pragma once

#include <Eigen/Core>
#include <optional>

#include "doppel/geometry/camera.h"

namespace doppel {

/// The matrix [v]x of the cross product: [v]x u = v x u.
Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v);
/// The rotation exp([turn]x) of a rotation vector, and its inverse.
Eigen::Matrix3d rotation_of(const Eigen::Vector3d& turn);
Eigen::Vector3d turn_of(const Eigen::Matrix3d& rotation);

/// The camera with its axes turned, R' = exp([turn]x) R, and its centre moved in the world.
Camera moved_by(const Camera& camera, const Eigen::Vector3d& turn, const Eigen::Vector3d& shift);

/// A projected point, with distortion, and how it changes.
struct CameraJacobian {
  Eigen::Vector2d pixel;
  Eigen::Matrix<double, 2, 3> by_turn;   ///< d pixel / d turn of moved_by
  Eigen::Matrix<double, 2, 3> by_point;  ///< d pixel / d point; by the camera's centre it is the negative
  Eigen::Vector2d by_focal;              ///< d pixel / d logarithm of a factor of the focal lengths
};
/// @return nothing for a point less than 5 cm in front of the camera, or where the lens gives no finite pixel
std::optional<CameraJacobian> camera_jacobian(const Camera& camera, const Eigen::Vector3d& point);
/// The pixel alone.
std::optional<Eigen::Vector2d> safe_pixel(const Camera& camera, const Eigen::Vector3d& point);

}  // namespace doppel
