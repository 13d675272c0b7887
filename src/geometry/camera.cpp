#include "doppel/geometry/camera.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

#include "doppel/core/error.h"

namespace doppel {
namespace {

constexpr double kAspectTolerance = 0.01;
constexpr double kRotationTolerance = 1e-4;
constexpr double kMaxNumber = 1e9;
constexpr int kMaxNewtonSteps = 40;
constexpr double kConverged = 1e-13, kDifference = 1e-6, kTiny = 1e-12;
constexpr double kMaxAngle = 1.55;  // radians; the tangent of pi / 2 is infinite

using Coefficients = std::array<double, 14>;

/// The tangential part of Brown's model.
Eigen::Vector2d tangential(const Eigen::Vector2d& p, double p1, double p2) {
  const double r2 = p.squaredNorm();
  return {2 * p1 * p.x() * p.y() + p2 * (r2 + 2 * p.x() * p.x()),
          p1 * (r2 + 2 * p.y() * p.y()) + 2 * p2 * p.x() * p.y()};
}

/// The image point on a sensor that is tilted by tx about x and ty about y (OpenCV's tilted model).
Eigen::Vector2d tilted(const Eigen::Vector2d& p, double tx, double ty) {
  if (tx == 0 && ty == 0) return p;
  const Eigen::Matrix3d rotation =
      (Eigen::AngleAxisd(-ty, Eigen::Vector3d::UnitY()) * Eigen::AngleAxisd(-tx, Eigen::Vector3d::UnitX()))
          .toRotationMatrix();
  Eigen::Matrix3d onto_sensor;
  onto_sensor << rotation(2, 2), 0, -rotation(0, 2), 0, rotation(2, 2), -rotation(1, 2), 0, 0, 1;
  return (onto_sensor * rotation * p.homogeneous()).hnormalized();
}

Eigen::Vector2d opencv(const Eigen::Vector2d& p, const Coefficients& c) {
  const auto& [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tx, ty] = c;
  const double r2 = p.squaredNorm();
  const double radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)));
  const Eigen::Vector2d prism(r2 * (s1 + r2 * s2), r2 * (s3 + r2 * s4));
  return tilted(radial * p + tangential(p, p1, p2) + prism, tx, ty);
}

Eigen::Vector2d polynomial(const Eigen::Vector2d& p, const Coefficients& c) {
  const double r2 = p.squaredNorm();
  const double radial = 1 + r2 * (c[0] + r2 * (c[1] + r2 * (c[4] + r2 * c[5])));
  return radial * p + tangential(p, c[2], c[3]);
}

Eigen::Vector2d fisheye(const Eigen::Vector2d& p, const Coefficients& c) {
  const double r = p.norm();
  if (r < kTiny) return p;
  const double theta = std::atan(r), t2 = theta * theta;
  return p * (theta * (1 + t2 * (c[0] + t2 * (c[1] + t2 * (c[2] + t2 * c[3])))) / r);
}

}  // namespace

bool Camera::has_distortion() const {
  return lens == Lens::fisheye || std::any_of(distortion.begin(), distortion.end(), [](double k) { return k != 0; });
}

Eigen::Vector2d Camera::distorted(const Eigen::Vector2d& point) const {
  switch (lens) {
    case Lens::fisheye:
      return fisheye(point, distortion);
    case Lens::polynomial:
      return polynomial(point, distortion);
    case Lens::opencv:
      break;
  }
  return opencv(point, distortion);
}

std::optional<Eigen::Vector2d> Camera::undistorted(const Eigen::Vector2d& point) const {
  if (!has_distortion()) return point;
  Eigen::Vector2d x = point;
  if (lens == Lens::fisheye) x *= std::tan(std::min(point.norm(), kMaxAngle)) / std::max(point.norm(), kTiny);
  for (int iteration = 0; iteration < kMaxNewtonSteps; ++iteration) {
    const Eigen::Vector2d residual = distorted(x) - point;
    if (!residual.allFinite()) return std::nullopt;
    if (residual.norm() < kConverged) return x;
    Eigen::Matrix2d jacobian;
    for (int axis = 0; axis < 2; ++axis) {
      Eigen::Vector2d step = Eigen::Vector2d::Zero();
      step[axis] = kDifference * (1.0 + x.norm());
      jacobian.col(axis) = (distorted(x + step) - distorted(x - step)) / (2.0 * step[axis]);
    }
    if (!(jacobian.determinant() > kTiny)) return std::nullopt;
    x -= jacobian.inverse() * residual;
  }
  return std::nullopt;
}

Eigen::Vector2d Camera::project(const Eigen::Vector3d& x_in_world) const {
  const Eigen::Vector3d p = camera_from_world(x_in_world);
  const Eigen::Vector2d d = distorted({p.x() / p.z(), p.y() / p.z()});
  return {K(0, 0) * d.x() + K(0, 1) * d.y() + K(0, 2), K(1, 1) * d.y() + K(1, 2)};
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
  if (width <= 0 || height <= 0 || width > kMaxImageSide || height > kMaxImageSide) {
    add(fmt::format("the image size is {}x{}, allowed is 1 to {} pixels per side", width, height, kMaxImageSide));
  }
  const bool finite = K.allFinite() && R.allFinite() && t.allFinite() &&
                      std::all_of(distortion.begin(), distortion.end(), [](double k) { return std::isfinite(k); });
  if (!finite) {
    add("holds a number that is not finite");
    return found;
  }
  const double largest = std::max({K.cwiseAbs().maxCoeff(), t.cwiseAbs().maxCoeff()});
  if (largest > kMaxNumber)
    add(fmt::format("holds the number {:.3g}; no camera has one above {:g}", largest, kMaxNumber));
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
  camera.lens = Lens::opencv;
  camera.distortion = {};
  return PinholeCamera(std::move(camera));
}

std::vector<PinholeCamera> pinhole_cameras(const std::vector<Camera>& cameras) {
  return {cameras.begin(), cameras.end()};
}

}  // namespace doppel
