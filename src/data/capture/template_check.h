#pragma once

#include <Eigen/Core>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "doppel/character/character.h"
#include "doppel/geometry/camera.h"

namespace doppel {

/// Compares the skinned template with masks. Not thread-safe.
class TemplateChecker {
 public:
  explicit TemplateChecker(const Character& character);
  ~TemplateChecker();
  TemplateChecker(const TemplateChecker&) = delete;
  TemplateChecker& operator=(const TemplateChecker&) = delete;

  /// The template in a pose: [3,N], world metres.
  Eigen::Matrix3Xf skin(const std::vector<double>& dofs);
  /// The template's silhouette as a mask of the camera's size.
  cv::Mat silhouette(const Eigen::Matrix3Xf& vertices, const Camera& camera);
  /// Intersection over union of silhouette and mask, at a width of at most 640 pixels; nothing when the mask is empty.
  std::optional<double> iou(const Eigen::Matrix3Xf& vertices, const Camera& camera, const cv::Mat& mask);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// The position of posed vertices relative to a camera.
struct CameraView {
  double distance = 0.0;        ///< from the camera to the vertices' mean, metres
  double share_in_front = 0.0;  ///< share of the vertices with positive depth
  double share_in_image = 0.0;  ///< share of the vertices in front of the camera and within the image
};
CameraView look_at(const Eigen::Matrix3Xf& vertices, const Camera& camera);

/// A likely reason why a template does not match its masks. Tries mirrored masks, inverted extrinsics, millimetres for
/// metres, and other common mistakes. Empty when none of them gives a better match.
std::string explain_misfit(TemplateChecker& checker, const Eigen::Matrix3Xf& vertices, const Camera& camera,
                           const cv::Mat& mask);

}  // namespace doppel
