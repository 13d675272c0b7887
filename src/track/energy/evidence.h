#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "doppel/detect/keypoints/keypoints.h"
#include "doppel/detect/masks/mask.h"
#include "doppel/geometry/camera.h"

namespace doppel {

/// Reference pixels are pixels of an image of this width. Residuals count in them, so that a weight means the same at
/// any resolution.
constexpr double kReferenceWidth = 1024.0;
/// The residual of a point that lies behind a camera which saw it, reference pixels.
constexpr double kBehindCamera = kReferenceWidth;
inline double reference_pixels(const PinholeCamera& camera) { return kReferenceWidth / camera.width; }

/// The distance field of a mask (+ outside, - inside) in a square window of the camera's image.
class OutlineField {
 public:
  OutlineField() = default;
  /// @param mask 0 or 255, of the camera's size; the field is empty when no pixel or every pixel shows the person
  /// @param pixels side of the window that the mask is resized to; at most two for each pixel of the image are used,
  /// because the mask has no finer detail
  /// @param margin around the person, relative to the longer side of its box
  OutlineField(const cv::Mat& mask, int pixels, double margin = 0.1);

  bool empty() const { return distance_.empty(); }
  /// The mask in the window, 0 or 255.
  cv::Mat inside() const { return distance_ < 0.0; }
  /// A point of the mask's outline, between two pixels.
  struct Point {
    Eigen::Vector2d pixel;   ///< of the camera's image
    Eigen::Vector2d normal;  ///< unit, out of the mask
  };
  /// Points of the outline, at most `most`, evenly spread.
  std::vector<Point> contour(int most) const;
  const CropBox& box() const { return box_; }
  int pixels() const { return distance_.cols; }

  struct Sample {
    double distance;           ///< pixels of the camera's image
    Eigen::Vector2d gradient;  ///< d distance / d (u, v)
  };
  /// Bilinear interpolation. Outside of the window: the value at the nearest point of the window plus the distance to
  /// it, so that the gradient points back to the window. @pre not empty() @param pixel of the camera's image
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

/// A projected point and its jacobian.
struct ProjectedPoint {
  Eigen::Vector2d pixel;
  Eigen::Matrix<double, 2, 3> jacobian;  ///< d pixel / d point in the world
};
/// @return nothing for a point less than 5 cm in front of the camera
std::optional<ProjectedPoint> project_with_jacobian(const PinholeCamera& camera, const Eigen::Vector3d& point);

}  // namespace doppel
