#include "doppel/nets/motion_graph_net.h"

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"
#include "doppel/layers/transform_math.h"

namespace doppel {

using torch::Tensor;

Tensor rest_vertices(const Character& character) {
  const Tensor rest = torch::empty({character.num_vertices(), 3}, torch::kFloat64);
  auto row = rest.accessor<double, 2>();
  for (int i = 0; i < character.num_vertices(); ++i)
    for (int axis = 0; axis < 3; ++axis) row[i][axis] = character.mesh.vertices[i][axis];
  return rest;
}

MotionGraphConfig::MotionGraphConfig() {
  sagcn.norm = SagcnNorm::none;
  sagcn.dense = DenseBlock::broadcast;
}

void describe_keys(const Keys& keys, MotionGraphConfig& config) {
  const SagcnConfig defaults = config.sagcn;
  describe_keys(keys, config.sagcn);
  keys("past_frames", config.past_frames, between(0, 100), "F, the past frames of the motion window");
  keys("heading", config.heading, {"removed", "kept"}, "which way the person faces is an input (6.25), or not");
  keys("input_limit", config.input_limit, at_least(0.0),
       "limit of the scaled inputs, standard deviations; 0: no limit");
  describe_network_kind(keys, config.network);
  describe_keys(keys, config.ablation);
  refuse_unread_keys(keys, config.network, config.sagcn, defaults, config.ablation);
}

void MotionGraphConfig::check() const {
  sagcn.check();
  ablation.check();
  if (past_frames < 0) fail<UsageError>("past_frames must not be negative, found {}", past_frames);
}

MotionGraphNetImpl::MotionGraphNetImpl(const std::string& name, const Character& character,
                                       const MotionGraphConfig& config, int outputs,
                                       std::optional<at::Generator> generator)
    : name_(name), config_(config), window_(character.skeleton), num_vertices_(character.num_vertices()) {
  config.check();
  kinematics_ = Kinematics(character);
  skinning_ = Skinning(character.skin, character.skinning);
  const bool flat = config.network == NetworkKind::fully_connected;
  NetworkPlan plan{config.network, config.sagcn, config.ablation};
  plan.inputs = (flat ? character.num_dofs() : 3) * (config.past_frames + 1);
  plan.outputs = outputs;
  network_ = make_network(plan, MeshTopology(character.mesh), std::move(generator));
  register_module(network_kind_words()[as_size(config.network)], network_);
  const int64_t rows = flat ? 1 : num_vertices_;
  input_mean_ = register_buffer("input_mean", torch::zeros({rows, plan.inputs}));
  input_std_ = register_buffer("input_std", torch::ones({rows, plan.inputs}));
  // Constants of the character, not of the model: they are not buffers and not in a checkpoint.
  rest_ = rest_vertices(character);
  rest_float_ = rest_.to(torch::kFloat32);
}

void MotionGraphNetImpl::set_input_statistics(const Tensor& mean, const Tensor& std, double floor) {
  set_standardisation(input_mean_, input_std_, mean, std, floor, name_.c_str());
}

Tensor MotionGraphNetImpl::network_input(const Tensor& dof_window) {
  const int64_t frames = config_.past_frames + 1;
  check_shape(name_.c_str(), "dof_window", dof_window, {-1, frames, window_.num_dofs()}, "[B,F+1,D]");
  const bool turned = config_.heading == Heading::removed;
  if (config_.network == NetworkKind::fully_connected)
    return (turned ? window_.normalise_dofs(dof_window) : window_.remove_translation(dof_window))
        .flatten(1)
        .unsqueeze(1);
  if (dof_window.size(0) == 0) return dof_window.new_zeros({0, num_vertices_, 3 * frames});

  const Tensor last = dof_window.select(1, frames - 1);
  const Tensor normaliser = turned ? window_.normaliser(last) : window_.translation_normaliser(last);
  const Tensor per_pose = normaliser.unsqueeze(1).expand({-1, frames, -1, -1}).flatten(0, 1).unsqueeze(1);
  const Tensor bones = compose(per_pose, kinematics_->bones(dof_window.flatten(0, 1)));
  const Tensor& rest = dof_window.scalar_type() == torch::kFloat32 ? rest_float_ : rest_;
  const Tensor posed = skinning_->forward(constant_like(rest, dof_window), bones);  // [B(F+1),N,3]
  return posed.view({-1, frames, num_vertices_, 3}).transpose(1, 2).flatten(2);
}

Tensor MotionGraphNetImpl::forward(const Tensor& dof_window) {
  return network_->forward(standardised(network_input(dof_window), input_mean_, input_std_, config_.input_limit));
}

}  // namespace doppel
