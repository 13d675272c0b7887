#pragma once

/// PoseNet (5.5): from one image of a person to joint angles and the rotation of the root seen from the camera.

#include <torch/torch.h>

#include <optional>
#include <utility>

#include "doppel/layers/pose_dofs.h"
#include "doppel/nets/resnet.h"

namespace doppel {

/// The thesis's last layer gives alpha itself. Here it gives a direction for the heading alpha_1, which is the angle of
/// that direction: images of a person who turns right round change smoothly, and so does a direction, while an angle
/// would have to jump by a full turn somewhere, and images near that place would get values between.
class PoseNetImpl : public torch::nn::Module {
 public:
  /// @param pose which joint angles, and where they start
  PoseNetImpl(const PoseDofs& pose, const BackboneConfig& config,
              std::optional<at::Generator> generator = std::nullopt);

  /// @param image [B,3,S,S], colours with ImageNet's mean and deviation taken out
  /// @return theta [B,P] and alpha [B,3] (pose_dofs.h). Without training theta is about the middle of its limits, alpha
  /// about upright and facing the camera.
  std::pair<torch::Tensor, torch::Tensor> forward(const torch::Tensor& image);

  Backbone& backbone() { return backbone_; }
  const BackboneConfig& config() const { return backbone_->config(); }

 private:
  int64_t num_angles_;
  Backbone backbone_{nullptr};
};
TORCH_MODULE(PoseNet);

}  // namespace doppel
