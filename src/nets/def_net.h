#pragma once

/// DefNet (5.6): from one image of a person to the embedded deformation of the template.

#include <torch/nn/module.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include <optional>
#include <utility>

#include "doppel/nets/resnet.h"

namespace doppel {

class DefNetImpl : public torch::nn::Module {
 public:
  /// @param num_nodes K of the character's graph
  DefNetImpl(int64_t num_nodes, const BackboneConfig& config, std::optional<at::Generator> generator = std::nullopt);

  /// @param image [B,3,S,S], colours standardised by ImageNet's mean and deviation
  /// @return A [B,K,3] Euler angles and T [B,K,3] metres of the nodes, in canonical pose
  std::pair<torch::Tensor, torch::Tensor> forward(const torch::Tensor& image);

  Backbone& backbone() { return backbone_; }
  int64_t num_nodes() const { return num_nodes_; }
  const BackboneConfig& config() const { return backbone_->config(); }

 private:
  int64_t num_nodes_;
  Backbone backbone_{nullptr};
};
TORCH_MODULE(DefNet);

}  // namespace doppel
