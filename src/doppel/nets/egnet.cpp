#include "doppel/nets/egnet.h"

#include "doppel/core/error.h"
#include "doppel/layers/embedded_deformation/embedded_deformation.h"
#include "doppel/layers/op_support.h"
#include "doppel/layers/transform_math.h"

namespace doppel {

using torch::Tensor;

namespace {

constexpr int kOutputs = 6;  // [T, A], the order of public checkpoints

const std::vector<std::string> kNodeFeatureWords{"graph", "transform"};
const std::vector<std::string> kRotationWords{"euler", "rotation_6d"};

Tensor node_positions(const Character& character) {
  const Tensor positions = torch::empty({character.num_nodes(), 3}, torch::kFloat64);
  auto row = positions.accessor<double, 2>();
  for (int k = 0; k < character.num_nodes(); ++k)
    for (int axis = 0; axis < 3; ++axis) row[k][axis] = character.mesh.vertices[character.graph.node_vertex[k]][axis];
  return positions;
}

}  // namespace

EgNetConfig EgNetConfig::preset(const std::string& name) {
  EgNetConfig config;  // the defaults are the thesis
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

EgNetConfig EgNetConfig::read(const ConfigReader& reader) {
  EgNetConfig config = preset(reader.choice("preset", {"paper", "public_checkpoint"}, "paper"));
  config.sagcn = SagcnConfig::read(reader, config.sagcn);
  config.window = reader.get("window", config.window, between(0, 100));
  const auto word = [](const std::vector<std::string>& words, auto value) {
    return words[static_cast<std::size_t>(value)];
  };
  config.node_features =
      reader.choice("node_features", kNodeFeatureWords, word(kNodeFeatureWords, config.node_features)) == "graph"
          ? NodeFeatures::graph
          : NodeFeatures::transform;
  config.rotation = reader.choice("rotation", kRotationWords, word(kRotationWords, config.rotation)) == "euler"
                        ? RotationFeatures::euler
                        : RotationFeatures::rotation_6d;
  config.rest_inverse = reader.get("rest_inverse", config.rest_inverse);
  config.input_limit = reader.get("input_limit", config.input_limit, at_least(0.0));
  config.network = read_network_kind(reader, config.network);
  config.ablation = AblationConfig::read(reader, config.ablation);
  if (config.node_features == NodeFeatures::graph && !config.rest_inverse)
    reader.fail_at_key("rest_inverse",
                       "node_features: graph measures how far a node moves from its rest position, which needs "
                       "rest_inverse: true; or choose node_features: transform");
  return config;
}

void EgNetConfig::check() const {
  sagcn.check();
  ablation.check();
  if (window < 0) fail<UsageError>("the motion window must hold no negative number of past frames, found {}", window);
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
  plan.inputs = flat ? character.num_dofs() * (config.window + 1) : config.num_inputs();
  plan.outputs = kOutputs;
  network_ = make_network(plan, MeshTopology(character.num_nodes(), character.graph.edges), std::move(generator));
  register_module(network_kind_words()[static_cast<std::size_t>(config.network)], network_);
  const int64_t rows = flat ? 1 : num_nodes_;
  input_mean_ = register_buffer("input_mean", torch::zeros({rows, plan.inputs}));
  input_std_ = register_buffer("input_std", torch::ones({rows, plan.inputs}));
  // Constants of the character, not of the model: neither buffers nor in a checkpoint.
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

Tensor EgNetImpl::node_features(const Tensor& dof_window) {
  const int64_t frames = config_.window + 1, per_frame = config_.features_per_frame();
  check_shape("egnet", "dof_window", dof_window, {-1, frames, window_.num_dofs()}, "[B,F+1,D]");
  if (dof_window.size(0) == 0) return dof_window.new_zeros({0, num_nodes_, config_.num_inputs()});

  const Tensor normaliser = window_.normaliser(dof_window.select(1, frames - 1));
  const Tensor per_pose = normaliser.unsqueeze(1).expand({-1, frames, -1, -1}).flatten(0, 1).unsqueeze(1);
  const Tensor bones = compose(per_pose, bone_transforms(dof_window.flatten(0, 1)));
  const Tensor nodes = node_skinning_->blend(bones);  // [B(F+1),K,3,4]

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
  check_shape("egnet", "dof_window", dof_window, {-1, config_.window + 1, window_.num_dofs()}, "[B,F+1,D]");
  return window_.normalise_dofs(dof_window).flatten(1).unsqueeze(1);
}

std::pair<Tensor, Tensor> EgNetImpl::forward(const Tensor& dof_window) {
  const Tensor output =
      network_->forward(standardised(network_input(dof_window), input_mean_, input_std_, config_.input_limit));
  return {output.narrow(-1, 3, 3), output.narrow(-1, 0, 3)};
}

}  // namespace doppel
