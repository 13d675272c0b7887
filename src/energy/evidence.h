#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "doppel/capture/keypoints.h"
#include "doppel/capture/mask.h"
#include "doppel/geometry/camera.h"

namespace doppel {

/// Pixels are counted as in images of this width, so that weights mean the same at any resolution.
constexpr double kReferenceWidth = 1024.0;
/// How far away, in those pixels, something counts that lies behind a camera which saw it.
constexpr double kBehindCamera = kReferenceWidth;
inline double reference_pixels(const Camera& camera) { return kReferenceWidth / camera.width; }

/// The signed distance to the outline of a mask (+ outside, - inside), in a square window of the camera's image.
class OutlineField {
 public:
  OutlineField() = default;
  /// @param mask 0 or 255, of the camera's size; without any or with nothing but person there is no field
  /// @param pixels side of the window that the mask is resized to, @param margin around the person, of its longer side
  OutlineField(const cv::Mat& mask, int pixels, double margin = 0.1);

  bool empty() const { return distance_.empty(); }
  /// The mask in the window, 0 or 255.
  cv::Mat inside() const { return distance_ < 0.0; }
  /// A point of the mask's outline, between two pixels.
  struct Point {
    Eigen::Vector2d pixel;   ///< of the camera's image
    Eigen::Vector2d normal;  ///< unit, out of the mask
  };
  /// At most so many of them, spread evenly.
  std::vector<Point> contour(int most) const;
  const CropBox& box() const { return box_; }
  int pixels() const { return distance_.cols; }

  struct Sample {
    double distance;           ///< pixels of the camera's image
    Eigen::Vector2d gradient;  ///< d distance / d (u, v)
  };
  /// Bilinear; outside of the window the value at its nearest point and the way there, so that what strays is drawn
  /// back. The field must not be empty. @param pixel of the camera's image
  Sample at(const Eigen::Vector2d& pixel) const;

 private:
  CropBox box_;
  cv::Mat distance_;  ///< float, pixels of the window
};

/// What one camera saw at one instant.
struct ViewEvidence {
  std::vector<Keypoint> keypoints;  ///< [M] in the order of the landmarks, pixels of the image without distortion
  OutlineField outline;
};

/// What all cameras saw at one instant, in the order of the cameras.
using FrameEvidence = std::vector<ViewEvidence>;

/// A pixel and its jacobian along a movement of the point, or nothing for a point that is not clearly in front.
struct ProjectedPoint {
  Eigen::Vector2d pixel;
  Eigen::Matrix<double, 2, 3> jacobian;  ///< d pixel / d point in the world
};
std::optional<ProjectedPoint> project_with_jacobian(const Camera& camera, const Eigen::Vector3d& point);

}  // namespace doppel
