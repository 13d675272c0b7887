#pragma once

/// PoseNet (5.5): from one picture of a person to joint angles and the rotation of the root seen from the camera.

#include <torch/torch.h>

#include <optional>
#include <utility>

#include "doppel/layers/pose_dofs.h"
#include "doppel/nets/resnet.h"

namespace doppel {

struct PoseNetConfig {
  BackboneConfig backbone;
  double head_scale = 1e-3;  ///< deviation of the last layer's first weights: training starts near the middle of limits

  /// Keys: `head_scale` and those of BackboneConfig. @throws FileError at the key
  static PoseNetConfig read(const ConfigReader& reader);
};

class PoseNetImpl : public torch::nn::Module {
 public:
  /// @param pose which joint angles, and where they start
  PoseNetImpl(const PoseDofs& pose, const PoseNetConfig& config, std::optional<at::Generator> generator = std::nullopt);

  /// @param image [B,3,S,S], colours with ImageNet's mean and deviation taken out
  /// @return theta [B,P] and alpha [B,3] (pose_dofs.h). Without training theta is about the middle of its limits, alpha
  /// about upright and facing the camera.
  std::pair<torch::Tensor, torch::Tensor> forward(const torch::Tensor& image);

  Backbone& backbone() { return backbone_; }
  const PoseNetConfig& config() const { return config_; }

 private:
  PoseNetConfig config_;
  int64_t num_angles_;
  Backbone backbone_{nullptr};
};
TORCH_MODULE(PoseNet);

}  // namespace doppel
