#pragma once

/// PoseNet (5.5): from one image of a person to joint angles and the rotation of the root relative to the camera.

#include <torch/nn/module.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include <optional>
#include <utility>

#include "doppel/layers/pose_dofs.h"
#include "doppel/nets/resnet.h"

namespace doppel {

/// The output for the heading alpha_1. `angle`: alpha_1 itself, as in the thesis. `direction`: a 2D direction whose
/// angle is alpha_1. A direction changes smoothly while a person makes a full turn. An angle jumps by 2 pi at one
/// heading, and images near this heading would get values in between.
enum class HeadingOutput { direction, angle };

struct PoseNetConfig : BackboneConfig {
  HeadingOutput heading = HeadingOutput::direction;
};
void describe_keys(const Keys& keys, PoseNetConfig& config);

class PoseNetImpl : public torch::nn::Module {
 public:
  /// @param pose the joint angles and their initial values
  PoseNetImpl(const PoseDofs& pose, const PoseNetConfig& config, std::optional<at::Generator> generator = std::nullopt);

  /// @param image [B,3,S,S], colours standardised by ImageNet's mean and deviation
  /// @return theta [B,P] and alpha [B,3] (pose_dofs.h). Before training, theta is about the middle of its limits, and
  /// alpha is about upright and facing the camera.
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
