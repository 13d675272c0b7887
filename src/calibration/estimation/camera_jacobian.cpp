#include "doppel/calibration/estimation/camera_jacobian.h"

#include <Eigen/Geometry>

#include "doppel/geometry/lens_jacobian.h"

namespace doppel {
namespace {

using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kNearestDepthOfPoint = 0.05;  // metres

}  // namespace

Matrix3d cross_matrix(const Vector3d& v) {
  Matrix3d cross;
  cross << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return cross;
}

Matrix3d rotation_of(const Vector3d& turn) {
  const double angle = turn.norm();
  return angle > 0.0 ? Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix() : Matrix3d(Matrix3d::Identity());
}

Vector3d turn_of(const Matrix3d& rotation) {
  const Eigen::AngleAxisd turn(rotation);
  return turn.angle() * turn.axis();
}

Camera moved_by(const Camera& camera, const Vector3d& turn, const Vector3d& shift) {
  Camera moved = camera;
  moved.R = rotation_of(turn) * camera.R;
  moved.t = -moved.R * (camera.centre() + shift);
  return moved;
}

std::optional<Vector2d> safe_pixel(const Camera& camera, const Vector3d& point) {
  const Vector3d in_camera = camera.camera_from_world(point);
  if (!(in_camera.z() >= kNearestDepthOfPoint)) return std::nullopt;
  const Vector2d pixel = camera.project(point);
  if (!pixel.allFinite()) return std::nullopt;
  return pixel;
}

std::optional<CameraJacobian> camera_jacobian(const Camera& camera, const Vector3d& point) {
  const auto pixel = safe_pixel(camera, point);
  if (!pixel) return std::nullopt;
  const Vector3d in_camera = camera.camera_from_world(point);
  const Vector2d plane = in_camera.hnormalized();
  const Matrix2d scale = camera.K.topLeftCorner<2, 2>();
  Eigen::Matrix<double, 2, 3> onto_plane;
  onto_plane << 1.0, 0.0, -plane.x(), 0.0, 1.0, -plane.y();
  const Eigen::Matrix<double, 2, 3> by_camera_point = scale * lens_jacobian(camera, plane) * onto_plane / in_camera.z();
  CameraJacobian result;
  result.pixel = *pixel;
  result.by_point = by_camera_point * camera.R;
  result.by_turn = -by_camera_point * cross_matrix(in_camera);
  result.by_focal = *pixel - camera.K.topRightCorner<2, 1>();
  return result;
}

}  // namespace doppel
