#pragma once

#include <torch/torch.h>

#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "doppel/character/character.h"
#include "doppel/geometry/camera.h"
#include "doppel/layers/surface.h"
#include "doppel/render/rasterizer.h"

namespace doppel {

/// Holds the skinned template against cameras and masks. Not thread-safe.
class TemplateChecker {
 public:
  explicit TemplateChecker(const Character& character);

  /// The template in a pose: float32 [N,3], world metres.
  torch::Tensor skin(const std::vector<double>& dofs);
  /// The template's silhouette as a mask of the camera's size.
  cv::Mat silhouette(const torch::Tensor& vertices, const Camera& camera);
  /// Intersection over union of silhouette and mask, at a width of at most 640 pixels; nothing when the mask is empty.
  std::optional<double> iou(const torch::Tensor& vertices, const Camera& camera, const cv::Mat& mask);

 private:
  CharacterSurface surface_;
  Rasterizer rasterizer_;
};

/// How posed vertices lie to a camera.
struct CameraView {
  double distance = 0.0;        ///< from the camera to the vertices' mean, metres
  double share_in_front = 0.0;  ///< share of the vertices with positive depth
  double share_in_image = 0.0;  ///< of all, in front and within the picture
};
CameraView look_at(const torch::Tensor& vertices, const Camera& camera);

/// A likely reason why a template does not fit its masks: tries mirrored masks, swapped direction of the extrinsics,
/// millimetres taken for metres, and other usual slips. Empty when none fits better.
std::string explain_misfit(TemplateChecker& checker, const torch::Tensor& vertices, const Camera& camera,
                           const cv::Mat& mask);

}  // namespace doppel
