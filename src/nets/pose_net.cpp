#include "doppel/nets/pose_net.h"

#include <cmath>

namespace doppel {

using torch::Tensor;

namespace {
constexpr int64_t kRotation = 4;  // cosine and sine of the heading (up to a factor), alpha_2, alpha_3
}  // namespace

PoseNetImpl::PoseNetImpl(const PoseDofs& pose, const BackboneConfig& config, std::optional<at::Generator> generator)
    : num_angles_(pose.size()) {
  const auto [heading, tilt, roll] = kUprightFacingCamera;
  const Tensor upright = torch::tensor({std::cos(heading), std::sin(heading), tilt, roll}, torch::kFloat64);
  backbone_ = register_module("backbone", Backbone(config, num_angles_ + kRotation,
                                                   torch::cat({pose.middle(), upright}), std::move(generator)));
}

std::pair<Tensor, Tensor> PoseNetImpl::forward(const Tensor& image) {
  const Tensor output = backbone_->forward(image);
  const Tensor rotation = output.narrow(1, num_angles_, kRotation);
  const Tensor heading = torch::atan2(rotation.narrow(1, 1, 1), rotation.narrow(1, 0, 1));
  return {output.narrow(1, 0, num_angles_), torch::cat({heading, rotation.narrow(1, 2, 2)}, 1)};
}

}  // namespace doppel
