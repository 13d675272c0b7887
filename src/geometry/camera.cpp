#include "doppel/geometry/camera.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

#include "doppel/core/error.h"

namespace doppel {
namespace {

constexpr double kAspectTolerance = 0.01;
constexpr double kRotationTolerance = 1e-4;
constexpr int kMaxSide = 1 << 16;

}  // namespace

bool Camera::has_distortion() const {
  return std::any_of(distortion.begin(), distortion.end(), [](double k) { return k != 0; });
}

Eigen::Vector2d Camera::project(const Eigen::Vector3d& x_in_world) const {
  const Eigen::Vector3d p = camera_from_world(x_in_world);
  const double x = p.x() / p.z(), y = p.y() / p.z();
  const auto& [k1, k2, p1, p2, k3, k4, k5, k6] = distortion;
  const double r2 = x * x + y * y;
  const double radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)));
  const double xd = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x);
  const double yd = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y;
  return {K(0, 0) * xd + K(0, 1) * yd + K(0, 2), K(1, 1) * yd + K(1, 2)};
}

Eigen::Matrix<double, 3, 4> Camera::projection() const {
  Eigen::Matrix<double, 3, 4> camera_from_world_matrix;
  camera_from_world_matrix << R, t;
  return K * camera_from_world_matrix;
}

Camera Camera::scaled_to(int new_width, int new_height) const {
  const double sx = static_cast<double>(new_width) / width, sy = static_cast<double>(new_height) / height;
  if (new_width <= 0 || new_height <= 0 || std::abs(sx / sy - 1) > kAspectTolerance) {
    fail(
        "camera {}: cannot use images of {}x{} with a calibration made for {}x{}: the aspect ratios differ by more "
        "than "
        "1 %; give images of the calibrated size, or resized without cropping",
        name, new_width, new_height, width, height);
  }
  Camera scaled = *this;
  scaled.width = new_width;
  scaled.height = new_height;
  scaled.K.row(0) *= sx;
  scaled.K.row(1) *= sy;
  return scaled;
}

Camera Camera::cropped(double u0, double v0, double scale, int new_width, int new_height) const {
  Camera crop = *this;
  crop.width = new_width;
  crop.height = new_height;
  crop.K(0, 2) -= u0;
  crop.K(1, 2) -= v0;
  crop.K.topRows<2>() *= scale;
  return crop;
}

std::vector<std::string> Camera::faults() const {
  std::vector<std::string> found;
  const auto add = [&](std::string sentence) { found.push_back(fmt::format("camera {}: {}", name, sentence)); };
  if (width <= 0 || height <= 0 || width > kMaxSide || height > kMaxSide) {
    add(fmt::format("the image size is {}x{}, allowed is 1 to {} pixels per side", width, height, kMaxSide));
  }
  const bool finite = K.allFinite() && R.allFinite() && t.allFinite() &&
                      std::all_of(distortion.begin(), distortion.end(), [](double k) { return std::isfinite(k); });
  if (!finite) {
    add("holds a number that is not finite");
    return found;
  }
  if (K(0, 0) <= 0 || K(1, 1) <= 0) {
    add(fmt::format("the focal lengths are {} and {} pixels, they must be positive", K(0, 0), K(1, 1)));
  }
  if (K(1, 0) != 0 || K(2, 0) != 0 || K(2, 1) != 0 || K(2, 2) != 1) {
    add("the intrinsic matrix must have the form fx s cx / 0 fy cy / 0 0 1");
  }
  const double deviation = (R * R.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (deviation > kRotationTolerance) {
    add(fmt::format("R is not a rotation: R R^T is off the identity by {:.3g}, allowed is {}", deviation,
                    kRotationTolerance));
  } else if (R.determinant() < 0) {
    add("R mirrors (its determinant is -1); the axes must be x right, y down, z forward");
  }
  return found;
}

PinholeCamera::PinholeCamera(Camera camera) : Camera(std::move(camera)) {
  if (has_distortion())
    fail("camera {} has lens distortion where a pinhole camera is needed; take the distortion out of its images first",
         name);
}

PinholeCamera without_distortion(Camera camera) {
  camera.distortion = {};
  return PinholeCamera(std::move(camera));
}

std::vector<PinholeCamera> pinhole_cameras(const std::vector<Camera>& cameras) {
  return {cameras.begin(), cameras.end()};
}

}  // namespace doppel
