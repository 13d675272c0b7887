#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "doppel/geometry/camera.h"

namespace doppel {

/// Removes the lens distortion from a camera's images.
class Undistorter {
 public:
  explicit Undistorter(const Camera& camera);
  /// The image as `pinhole()` would see it; the input itself when the camera has no distortion.
  cv::Mat apply(const cv::Mat& image) const;
  /// The position in the image of `pinhole()` that corresponds to a pixel of the distorted camera. Finite for finite
  /// pixels.
  Eigen::Vector2d apply(const Eigen::Vector2d& pixel) const;
  /// The camera without distortion: same K, size and pose.
  const PinholeCamera& pinhole() const { return pinhole_; }

 private:
  Camera camera_;
  PinholeCamera pinhole_;
  cv::Mat map1_, map2_;
};

}  // namespace doppel
