#pragma once

#include <Eigen/Core>
#include <optional>
#include <utility>
#include <vector>

#include "doppel/calibration/estimation/point_tracks.h"
#include "doppel/geometry/camera.h"

namespace doppel {

/// A pair of calibrated cameras: how far two image points are from being views of one point.
class EpipolarPair {
 public:
  EpipolarPair(const Camera& a, const Camera& b);

  /// The fundamental matrix F: u_b^T F u_a = 0 for homogeneous pixels of the images without distortion.
  const Eigen::Matrix3d& fundamental() const { return fundamental_; }
  /// The Sampson distance of two pixels of the images without distortion: about the distance, in pixels, by which the
  /// two must be moved together until they satisfy the epipolar equation (Hartley and Zisserman, 11.9). Signed.
  double distance(const Eigen::Vector2d& a, const Eigen::Vector2d& b) const;

 private:
  Eigen::Matrix3d fundamental_;
};

/// The pixel without lens distortion: where a pinhole camera with the same intrinsics sees the point.
/// @return nothing for pixels that are not finite, or where the lens has no inverse
std::optional<Eigen::Vector2d> straight_pixel(const Camera& camera, const Eigen::Vector2d& pixel);

/// The pixel as filmed: the inverse of straight_pixel.
Eigen::Vector2d filmed_pixel(const Camera& camera, const Eigen::Vector2d& straight);

/// The tracks without lens distortion. Points where a lens has no inverse are not seen.
PointTracks straight_tracks(const std::vector<Camera>& cameras, const PointTracks& tracks);

/// Pairs of cameras that are compared: all for few cameras. For many, each camera with those that look at the person
/// from the most different sides, but not from opposite ones, where both move along the same lines.
std::vector<std::pair<int, int>> pairs_to_compare(const std::vector<Camera>& cameras);

/// How well two cameras agree.
struct EpipolarAgreement {
  int a = 0, b = 0;     ///< cameras
  long samples = 0;     ///< pairs of points
  double median = 0.0;  ///< absolute Sampson distance, pixels; 0 without samples
};

/// The agreement of every pair of cameras at given common times.
/// @param times seconds, as PointTracks::times
/// @throws Error as check_tracks, for fewer than two cameras
std::vector<EpipolarAgreement> epipolar_agreement(const std::vector<Camera>& cameras, const PointTracks& tracks,
                                                  const std::vector<double>& times);

}  // namespace doppel
