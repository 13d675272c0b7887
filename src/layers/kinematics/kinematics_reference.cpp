#include "doppel/core/tensor/checks.h"
#include "doppel/layers/kinematics/kinematics.h"
#include "doppel/layers/transform_math.h"

namespace doppel {
namespace {

/// Parent-from-joint transforms, with an identity as joint J: [B,J+1,3,4].
torch::Tensor local_transforms(const torch::Tensor& q, const KinematicChain& chain) {
  const auto on = [&](const torch::Tensor& constant) { return constant_like(constant, q); };
  const torch::Tensor angle = q.unsqueeze(-1).unsqueeze(-1);
  // Rodrigues' formula; the skew matrices of prismatic joints are zero.
  const torch::Tensor rotation =
      torch::eye(3, q.options()) + angle.sin() * on(chain.skew) + (1.0 - angle.cos()) * on(chain.skew_squared);
  const torch::Tensor translation = on(chain.offset) + q.unsqueeze(-1) * on(chain.slide);
  return make_transform(rotation, translation);
}

}  // namespace

torch::Tensor forward_kinematics_reference(const torch::Tensor& dofs, const KinematicChain& chain,
                                           const RiddenFrames& frames) {
  check_shape("forward_kinematics", "dofs", dofs, {-1, chain.num_dofs}, "[B,D]");
  const torch::Tensor exact = dofs.to(torch::kFloat64);
  torch::Tensor transforms = local_transforms(torch::matmul(exact, constant_like(chain.weights, exact)), chain);
  // Pointer jumping: before round r, each joint has its transform from its 2^r-th ancestor. The round doubles this
  // distance. A chain of 60 joints takes 6 rounds instead of 60 steps.
  for (const torch::Tensor& ancestor : chain.ancestors) {
    transforms = compose(transforms.index_select(1, index_like(ancestor, exact)), transforms);
  }
  return compose(transforms.index_select(1, index_like(frames.joint, exact)), constant_like(frames.local, exact))
      .to(dofs.scalar_type());
}

}  // namespace doppel
