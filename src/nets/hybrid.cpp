#include "doppel/nets/hybrid.h"

#include "doppel/nets/motion_window.h"

namespace doppel {

namespace {

constexpr uint64_t kHybridSeed = 1;
constexpr double kFeatureScale = 0.1;

/// Copies parameters and buffers of one module to another of the same kind.
void copy_weights(torch::nn::Module& from, torch::nn::Module& to) {
  const torch::NoGradGuard no_grad;
  const auto parameters = from.named_parameters();
  for (auto& item : to.named_parameters()) item.value().copy_(parameters[item.key()]);
  const auto buffers = from.named_buffers();
  for (auto& item : to.named_buffers()) item.value().copy_(buffers[item.key()]);
}

/// Rest positions [N,3] relative to the centre of the template's box, scaled to a largest coordinate of 1.
torch::Tensor normalised_positions(const Character& character) {
  const torch::Tensor rest = rest_vertices(character);
  const torch::Tensor low = std::get<0>(rest.min(0)), high = std::get<0>(rest.max(0));
  return ((rest - 0.5 * (low + high)) / (0.5 * (high - low).max())).to(torch::kFloat32);
}

}  // namespace

HybridConfig::HybridConfig() {
  motion.sagcn.head_scale = kFeatureScale;
  motion.heading = Heading::kept;
}

void describe_keys(const Keys& keys, HybridConfig& config) {
  describe_keys(keys.section("motion"), config.motion);
  describe_keys(keys.section("field"), config.field);
}

HybridImpl::HybridImpl(const Character& character, DeltaNet& deltanet, const HybridConfig& config,
                       std::optional<at::Generator> generator)
    : config_(config) {
  at::Generator draw = generator ? *generator : at::detail::createCPUGenerator(kHybridSeed);
  refined = register_module("refined", DeltaNet(character, deltanet->config(), draw));
  around = register_module("around", DeltaNet(character, deltanet->config(), draw));
  motion = register_module("motion",
                           MotionGraphNet("motion features", character, config.motion, config.field.features, draw));
  field = register_module("field", RadianceField(config.field, draw));
  if (config.field.place_octaves > 0) positions_ = normalised_positions(character);
  copy_weights(*deltanet, *refined);
  for (torch::Tensor& parameter : around->parameters()) parameter.requires_grad_(false);
  follow();
}

void HybridImpl::train(bool on) {
  torch::nn::Module::train(on);
  refined->eval();
  around->eval();
}

void HybridImpl::follow() { copy_weights(*refined, *around); }

torch::Tensor HybridImpl::vertex_values(const torch::Tensor& dof_window) {
  const torch::Tensor features = motion->forward(last_rows(dof_window, config_.motion.past_frames))[0];
  return positions_.defined() ? torch::cat({features, positions_.to(features)}, 1) : features;
}

}  // namespace doppel
