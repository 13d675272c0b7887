#include "doppel/nets/delta_net.h"

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel {

using torch::Tensor;

namespace {

constexpr int kDeltaNetOutputs = 3;

const std::vector<std::string> kSpaceWords{"canonical", "global"};

}  // namespace

DeltaNetConfig DeltaNetConfig::preset(const std::string& name) {
  if (name != "paper") fail<UsageError>("unknown DeltaNet preset '{}'; there is paper", name);
  return {};
}

DeltaNetConfig DeltaNetConfig::read(const ConfigReader& reader) {
  DeltaNetConfig config = preset(reader.choice("preset", {"paper"}, "paper"));
  static_cast<MotionGraphConfig&>(config) = MotionGraphConfig::read(reader, config);
  config.space = reader.choice("space", kSpaceWords, kSpaceWords[as_size(config.space)]) == "canonical"
                     ? DisplacementSpace::canonical
                     : DisplacementSpace::global;
  return config;
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
