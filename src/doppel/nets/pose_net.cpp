#include "doppel/nets/pose_net.h"

namespace doppel {

using torch::Tensor;

PoseNetConfig PoseNetConfig::read(const ConfigReader& reader) {
  PoseNetConfig config;
  config.backbone = BackboneConfig::read(reader, config.backbone);
  config.head_scale = reader.get("head_scale", config.head_scale, at_least(0.0));
  return config;
}

PoseNetImpl::PoseNetImpl(const PoseDofs& pose, const PoseNetConfig& config, std::optional<at::Generator> generator)
    : config_(config), num_angles_(pose.size()) {
  const Tensor upright =
      torch::tensor({kUprightFacingCamera[0], kUprightFacingCamera[1], kUprightFacingCamera[2]}, torch::kFloat64);
  backbone_ = register_module("backbone", Backbone(config.backbone, num_angles_ + 3, config.head_scale,
                                                   torch::cat({pose.middle(), upright}), std::move(generator)));
}

std::pair<Tensor, Tensor> PoseNetImpl::forward(const Tensor& image) {
  const Tensor output = backbone_->forward(image);
  return {output.narrow(1, 0, num_angles_), output.narrow(1, num_angles_, 3)};
}

}  // namespace doppel
