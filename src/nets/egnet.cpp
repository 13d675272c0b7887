#include "doppel/nets/egnet.h"

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"
#include "doppel/layers/embedded_deformation/embedded_deformation.h"
#include "doppel/layers/transform_math.h"

namespace doppel {

using torch::Tensor;

namespace {

constexpr int kEgNetOutputs = 6;  // [T, A], the order of public checkpoints

Tensor node_positions(const Character& character) {
  const Tensor positions = torch::empty({character.num_nodes(), 3}, torch::kFloat64);
  auto row = positions.accessor<double, 2>();
  for (int k = 0; k < character.num_nodes(); ++k)
    for (int axis = 0; axis < 3; ++axis) row[k][axis] = character.mesh.vertices[character.graph.node_vertex[k]][axis];
  return positions;
}

}  // namespace

EgNetConfig EgNetConfig::preset(const std::string& name) {
  EgNetConfig config;  // the defaults are those of the thesis
  if (name == "public_checkpoint") {
    config.sagcn.rings = 2;
    config.sagcn.initialisation = SagcnInitialisation::public_code;
    config.node_features = NodeFeatures::transform;
    config.rest_inverse = false;
  } else if (name != "paper") {
    fail<UsageError>("unknown EGNet preset '{}'; there are paper and public_checkpoint", name);
  }
  return config;
}

void describe_keys(const Keys& keys, EgNetConfig& config) {
  bool public_checkpoint = false;
  keys("preset", public_checkpoint, {"paper", "public_checkpoint"},
       "the values of the thesis, or those of the public checkpoint: R = 2, and inputs and initial weights of its own");
  if (public_checkpoint) config = EgNetConfig::preset("public_checkpoint");
  const EgNetConfig defaults = config;
  describe_keys(keys, config.sagcn);
  keys("past_frames", config.past_frames, between(0, 100), "F, the past frames of the motion window");
  keys("rotation", config.rotation, {"euler", "rotation_6d"}, "angles, or numbers without jumps at 2 pi");
  keys("input_limit", config.input_limit, at_least(0.0),
       "limit of the scaled inputs, standard deviations, so that a pose unlike all training poses cannot distort the "
       "surface; 0: no limit");
  keys("inertia", config.inertia, between(0, 100),
       "past frames over which nodes trail behind their bones; 0: none, as in the thesis");
  keys("inertia_modes", config.inertia_modes, between(1, 8), "damped oscillations of this motion");
  describe_network_kind(keys, config.network);
  describe_keys(keys, config.ablation);
  refuse_unread_keys(keys, config.network, config.sagcn, defaults.sagcn, config.ablation);
  keys.require("rotation", config.network != NetworkKind::fully_connected || config.rotation == defaults.rotation,
               "the input of `network: fully_connected` is the DoFs, not rotations of nodes; leave the key out, or "
               "choose another network");
  keys.require("inertia_modes", config.inertia > 0 || config.inertia_modes == defaults.inertia_modes,
               "nodes have no inertia without `inertia`; set inertia to a number of past frames, for example 12, or "
               "leave inertia_modes out");
}

void EgNetConfig::check() const {
  sagcn.check();
  ablation.check();
  if (inertia < 0 || inertia_modes < 1)
    fail<UsageError>("inertia must be at least 0 frames and inertia_modes at least 1, found {} and {}", inertia,
                     inertia_modes);
  if (past_frames < 0) fail<UsageError>("past_frames must not be negative, found {}", past_frames);
  if (node_features == NodeFeatures::graph && !rest_inverse)
    fail<UsageError>("node_features: graph needs rest_inverse: true; or choose node_features: transform");
}

EgNetImpl::EgNetImpl(const Character& character, const EgNetConfig& config, std::optional<at::Generator> generator)
    : config_(config), window_(character.skeleton), num_nodes_(character.num_nodes()) {
  config.check();
  kinematics_ = Kinematics(character);
  node_skinning_ = Skinning(node_skinning_weights(character), SkinningMode::dual_quaternion);
  const bool flat = config.network == NetworkKind::fully_connected;
  NetworkPlan plan{config.network, config.sagcn, config.ablation};
  plan.inputs = flat ? character.num_dofs() * (config.past_frames + 1) : config.num_inputs();
  plan.outputs = kEgNetOutputs;
  network_ = make_network(plan, MeshTopology(character.num_nodes(), character.graph.edges), std::move(generator));
  register_module(network_kind_words()[as_size(config.network)], network_);
  const int64_t rows = flat ? 1 : num_nodes_;
  input_mean_ = register_buffer("input_mean", torch::zeros({rows, plan.inputs}));
  input_std_ = register_buffer("input_std", torch::ones({rows, plan.inputs}));
  if (config.inertia > 0) {
    inertia_gain_ = register_parameter("inertia_gain", torch::zeros({2 * config.inertia_modes * num_nodes_}));
    const Tensor mode = torch::arange(config.inertia_modes, torch::kFloat32);
    inertia_decay_ = register_parameter("inertia_decay", at::log(0.2 * at::exp2(mode)));
    inertia_frequency_ = register_parameter("inertia_frequency", 0.3 * at::exp2(mode));
  }
  // Constants of the character, not of the model: they are not buffers and not in a checkpoint.
  node_positions_ = node_positions(character);
  const std::vector<int64_t> joints(character.bone_joint.begin(), character.bone_joint.end());
  bone_joint_ = torch::tensor(joints, torch::kInt64);
}

void EgNetImpl::set_input_statistics(const Tensor& mean, const Tensor& std, double floor) {
  set_standardisation(input_mean_, input_std_, mean, std, floor, "EGNet");
}

/// Bone transforms of each pose, world. @param dofs [P,D] @return [P,Bn,3,4]
Tensor EgNetImpl::bone_transforms(const Tensor& dofs) {
  if (config_.rest_inverse) return kinematics_->bones(dofs);
  return kinematics_->joints(dofs).index_select(1, bone_joint_.to(dofs.device()));
}

/// Skinned transforms of all nodes at each frame of the window, relative to the root of the last frame.
/// @return [B(F+1),K,3,4]
Tensor EgNetImpl::node_transforms(const Tensor& dof_window) {
  const int64_t frames = dof_window.size(1);
  const Tensor normaliser = window_.normaliser(dof_window.select(1, frames - 1));
  const Tensor per_pose = normaliser.unsqueeze(1).expand({-1, frames, -1, -1}).flatten(0, 1).unsqueeze(1);
  return node_skinning_->blend(compose(per_pose, bone_transforms(dof_window.flatten(0, 1))));
}

Tensor EgNetImpl::node_features(const Tensor& dof_window) {
  const int64_t frames = config_.past_frames + 1, per_frame = config_.features_per_frame();
  check_shape("egnet", "dof_window", dof_window, {-1, frames, window_.num_dofs()}, "[B,F+1,D]");
  if (dof_window.size(0) == 0) return dof_window.new_zeros({0, num_nodes_, config_.num_inputs()});

  const Tensor nodes = node_transforms(dof_window);
  const Tensor rotation = nodes.narrow(-1, 0, 3);
  Tensor translation = nodes.select(-1, 3);
  if (config_.node_features == NodeFeatures::graph) {
    const Tensor g = node_positions_.to(nodes.device(), nodes.scalar_type());
    translation = translation + (rotation * g.unsqueeze(1)).sum(-1) - g;
  }
  const Tensor turn = config_.rotation == RotationFeatures::euler
                          ? matrix_to_euler(rotation)
                          : at::cat({rotation.select(-1, 0), rotation.select(-1, 1)}, -1);
  return at::cat({translation, turn}, -1).view({-1, frames, num_nodes_, per_frame}).permute({0, 2, 1, 3}).flatten(2);
}

Tensor EgNetImpl::network_input(const Tensor& dof_window) {
  if (config_.network != NetworkKind::fully_connected) return node_features(dof_window);
  check_shape("egnet", "dof_window", dof_window, {-1, config_.past_frames + 1, window_.num_dofs()}, "[B,F+1,D]");
  return window_.normalise_dofs(dof_window).flatten(1).unsqueeze(1);
}

/// w_k(j) of all nodes, oldest frame first, [P,K].
Tensor EgNetImpl::inertia_weights() const {
  const Tensor age = at::arange(config_.inertia, 0, -1, inertia_decay_.options()).unsqueeze(1);  // frames
  const Tensor fade = at::exp(-age * at::exp(inertia_decay_)), phase = age * inertia_frequency_;
  const Tensor response = at::cat({fade * at::cos(phase), fade * at::sin(phase)}, 1);  // [P,2 modes]
  return at::matmul(response, inertia_gain_.view({2 * config_.inertia_modes, num_nodes_}));
}

Tensor EgNetImpl::inertia(const Tensor& dof_window) {
  if (config_.inertia == 0) fail<UsageError>("this EGNet was built without inertia (model.inertia: 0)");
  const int64_t past = config_.inertia;
  const Tensor nodes = node_transforms(last_rows(dof_window, config_.inertia)).view({-1, past + 1, num_nodes_, 3, 4});
  const Tensor rotation = nodes.narrow(-1, 0, 3), g = node_positions_.to(nodes.device(), nodes.scalar_type());
  const Tensor path = (rotation * g.unsqueeze(1)).sum(-1) + nodes.select(-1, 3);  // x_k, [B,P+1,K,3]
  const Tensor behind = path.narrow(1, 0, past) - path.narrow(1, past, 1);
  const Tensor lag = (behind * inertia_weights().to(nodes.scalar_type()).unsqueeze(-1)).sum(1);
  return (rotation.select(1, past) * lag.unsqueeze(-1)).sum(-2);  // R^T lag
}

std::pair<Tensor, Tensor> EgNetImpl::forward(const Tensor& seen_window, const Tensor& dof_window) {
  const Tensor seen = last_rows(seen_window, config_.past_frames);
  const Tensor output =
      network_->forward(standardised(network_input(seen), input_mean_, input_std_, config_.input_limit));
  Tensor T = output.narrow(-1, 0, 3);
  if (config_.inertia > 0) T = T + inertia(dof_window);
  return {output.narrow(-1, 3, 3), T};
}

}  // namespace doppel
