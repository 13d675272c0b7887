#include "doppel/nets/delta_net.h"

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel {

using torch::Tensor;

namespace {

constexpr int kDeltaNetOutputs = 3;

}  // namespace

void describe_keys(const Keys& keys, DeltaNetConfig& config) {
  bool other_preset = false;
  keys("preset", other_preset, {"paper"}, "no effect; configs/paper/ddc.yaml has the values of the thesis");
  describe_keys(keys, static_cast<MotionGraphConfig&>(config));
  keys("space", config.space, {"canonical", "global"}, "displace before skinning, or after it (an ablation)");
}

DeltaNetImpl::DeltaNetImpl(const Character& character, const DeltaNetConfig& config,
                           std::optional<at::Generator> generator)
    : MotionGraphNetImpl("DeltaNet", character, config, kDeltaNetOutputs, std::move(generator)), config_(config) {}

Tensor DeltaNetImpl::displaced(CharacterSurface& surface, const Tensor& dof_window, const Tensor& A, const Tensor& T,
                               const Tensor& D) {
  const Tensor dofs = dof_window.select(1, config_.past_frames).contiguous();
  if (config_.space == DisplacementSpace::canonical) return surface->deformed(dofs, A, T, D);
  // Rows times R(-phi) are columns rotated by phi: from the axes of the heading to world axes.
  return surface->deformed(dofs, A, T) + at::matmul(D, motion_window().normaliser(dofs).narrow(-1, 0, 3));
}

}  // namespace doppel
