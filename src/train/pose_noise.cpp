#include "doppel/train/pose_noise.h"

#include <algorithm>
#include <cmath>

namespace doppel {

namespace {

/// DoF units per radian, so that noise has the same size in radians for joints with different weights.
torch::Tensor radians_to_dof(const Skeleton& skeleton) {
  torch::Tensor scale = torch::zeros({skeleton.num_dofs()});
  for (int d = 0; d < skeleton.num_dofs(); ++d) {
    double largest = 0.0;
    for (const Dof::Drive& drive : skeleton.dofs[d].joints)
      if (skeleton.joints[drive.joint].type == Joint::Type::revolute)
        largest = std::max(largest, std::abs(drive.weight));
    if (largest > 0.0) scale[d] = 1.0 / largest;
  }
  return scale;
}

}  // namespace

void describe_keys(const Keys& keys, PoseNoiseOptions& options) {
  keys("input_noise", options.input, between(0.0, 1.0),
       "standard deviation, radians, of noise on each joint angle that the network sees; drawn for each frame of the "
       "motion window");
  keys("pose_noise", options.pose, between(0.0, 1.0),
       "the same, but one draw for all frames of the motion window: velocities stay");
}

PoseNoise::PoseNoise(const Skeleton& skeleton, const PoseNoiseOptions& options)
    : options_(options), radians_to_dof_(radians_to_dof(skeleton)) {}

torch::Tensor PoseNoise::apply(const torch::Tensor& dof_window, const torch::nn::Module& network,
                               const at::Generator& generator, const BatchShare& share) const {
  if (!network.is_training()) return dof_window;
  const auto normal = [&](std::vector<std::int64_t> sizes, double deviation) {
    return share.rows(torch::empty(share.whole_sizes(sizes)).normal_(0.0, deviation, generator));
  };
  torch::Tensor out = dof_window;
  if (options_.pose > 0.0)
    out = out + normal({dof_window.size(0), 1, dof_window.size(2)}, options_.pose) * radians_to_dof_;
  if (options_.input > 0.0) out = out + normal(dof_window.sizes().vec(), options_.input) * radians_to_dof_;
  return out;
}

}  // namespace doppel
