#include "doppel/nets/def_net.h"

namespace doppel {

using torch::Tensor;

namespace {
constexpr int kDefNetOutputs = 6;  // [T, A], as in EGNet
}  // namespace

DefNetImpl::DefNetImpl(int64_t num_nodes, const BackboneConfig& config, std::optional<at::Generator> generator)
    : num_nodes_(num_nodes) {
  const int64_t outputs = kDefNetOutputs * num_nodes;
  backbone_ = register_module("backbone", Backbone(config, outputs, torch::zeros({outputs}), std::move(generator)));
}

std::pair<Tensor, Tensor> DefNetImpl::forward(const Tensor& image) {
  const Tensor output = backbone_->forward(image).view({-1, num_nodes_, kDefNetOutputs});
  return {output.narrow(-1, 3, 3), output.narrow(-1, 0, 3)};
}

}  // namespace doppel
