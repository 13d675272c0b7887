#include "doppel/nets/pose_net.h"

#include <cmath>

namespace doppel {

using torch::Tensor;

void describe_keys(const Keys& keys, PoseNetConfig& config) {
  describe_keys(keys, static_cast<BackboneConfig&>(config));
  keys("heading", config.heading, {"direction", "angle"},
       "output for the heading: a direction, or its angle, as in the thesis");
}

PoseNetImpl::PoseNetImpl(const PoseDofs& pose, const PoseNetConfig& config, std::optional<at::Generator> generator)
    : config_(config), num_angles_(pose.size()) {
  const auto [heading, tilt, roll] = kUprightFacingCamera;
  const Tensor upright = config.heading == HeadingOutput::angle
                             ? torch::tensor({heading, tilt, roll}, torch::kFloat64)
                             : torch::tensor({std::cos(heading), std::sin(heading), tilt, roll}, torch::kFloat64);
  backbone_ = register_module("backbone", Backbone(config, num_angles_ + upright.size(0),
                                                   torch::cat({pose.middle(), upright}), std::move(generator)));
}

std::pair<Tensor, Tensor> PoseNetImpl::forward(const Tensor& image) {
  const Tensor output = backbone_->forward(image);
  const Tensor theta = output.narrow(1, 0, num_angles_);
  const Tensor rotation = output.narrow(1, num_angles_, output.size(1) - num_angles_);
  if (config_.heading == HeadingOutput::angle) return {theta, rotation};
  const Tensor heading = torch::atan2(rotation.narrow(1, 1, 1), rotation.narrow(1, 0, 1));
  return {theta, torch::cat({heading, rotation.narrow(1, 2, 2)}, 1)};
}

}  // namespace doppel
