#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>
#include <vector>

namespace doppel {

/// How the coefficients of a lens move an image point. x and y are the coordinates of the point without distortion at
/// depth 1, r^2 = x^2 + y^2, theta = atan(r).
enum class Lens {
  opencv,      ///< k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 tx ty: radial (rational), tangential, thin prism, tilted sensor
  fisheye,     ///< k1 k2 k3 k4 of theta (1 + k1 theta^2 + ... + k4 theta^8): OpenCV's fisheye, Kalibr's equidistant
  polynomial,  ///< k1 k2 p1 p2 k3 k4: as opencv, but with x (1 + k1 r^2 + k2 r^4 + k3 r^6 + k4 r^8): Metashape
};

/// The longest side of an image that is read from a file, pixels: memory is allocated by it.
inline constexpr int kMaxImageSide = 1 << 16;

/// A calibrated camera with lens distortion.
///
/// World and camera coordinates are in metres. The camera looks along +z, with x to the right and y down. The image
/// spans [0,width] x [0,height], so the centre of the first pixel is (0.5, 0.5).
struct Camera {
  std::string name;
  int width = 0, height = 0;                        ///< pixels
  Eigen::Matrix3d K = Eigen::Matrix3d::Identity();  ///< intrinsics, pixels (fx s cx; 0 fy cy; 0 0 1)
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();  ///< rotation, camera from world
  Eigen::Vector3d t = Eigen::Vector3d::Zero();      ///< translation, camera from world, metres
  Lens lens = Lens::opencv;
  std::array<double, 14> distortion{};  ///< coefficients in the order of `lens`, then zeros

  /// Camera centre in the world, -R^T t.
  Eigen::Vector3d centre() const { return -R.transpose() * t; }
  bool has_distortion() const;
  /// The image point at depth 1 after distortion. @param point (x/z, y/z) in camera coordinates
  Eigen::Vector2d distorted(const Eigen::Vector2d& point) const;
  /// The inverse of `distorted`, by Newton steps. Nothing where the lens has no inverse, which happens far outside of
  /// the image.
  std::optional<Eigen::Vector2d> undistorted(const Eigen::Vector2d& point) const;
  Eigen::Vector3d camera_from_world(const Eigen::Vector3d& x_in_world) const { return R * x_in_world + t; }
  /// Pixel of a world point, with distortion. Undefined for points with camera z <= 0.
  Eigen::Vector2d project(const Eigen::Vector3d& x_in_world) const;
  /// Projection matrix K [R|t], without distortion: (u z, v z, z) = P (x, 1).
  Eigen::Matrix<double, 3, 4> projection() const;

  /// This camera for its image resized to another resolution.
  /// @throws Error when the aspect ratio differs by more than 1 %.
  Camera scaled_to(int new_width, int new_height) const;
  /// This camera for the part of its image that starts at pixel (u0, v0), resized by `scale` (output pixels per
  /// input pixel): u' = (u - u0) * scale.
  Camera cropped(double u0, double v0, double scale, int new_width, int new_height) const;

  /// All faults of this camera in plain sentences (empty: none): sizes, focal lengths, R not a rotation, NaN.
  std::vector<std::string> faults() const;
};

/// A camera whose images have no lens distortion: what drawing and fitting need.
class PinholeCamera : public Camera {
 public:
  PinholeCamera() = default;
  /// @throws Error for a camera with distortion; `Undistorter` makes a pinhole camera and its images
  explicit PinholeCamera(Camera camera);

  /// As Camera::cropped. @return a pinhole camera again
  PinholeCamera cropped(double u0, double v0, double scale, int new_width, int new_height) const {
    return PinholeCamera(Camera::cropped(u0, v0, scale, new_width, new_height));
  }
};
/// The camera without its distortion: same K, size and pose.
PinholeCamera without_distortion(Camera camera);
std::vector<PinholeCamera> pinhole_cameras(const std::vector<Camera>& cameras);

}  // namespace doppel
