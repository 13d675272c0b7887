#pragma once

/// EGNet (6.5.1): from a motion window to the embedded deformation (A, T) of its last pose.

#include <torch/nn/module.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "doppel/character/character.h"
#include "doppel/core/options.h"
#include "doppel/layers/kinematics/kinematics.h"
#include "doppel/layers/skinning/skinning.h"
#include "doppel/nets/ablation_nets.h"
#include "doppel/nets/motion_window.h"

namespace doppel {

/// The input features of a node's skinned transform M_k.
/// `graph`: the translation of the node at g_k, M_k g_k - g_k. `transform`: the last column of M_k.
enum class NodeFeatures { graph, transform };
/// Euler angles (3 numbers, discontinuous at 2 pi) or the first two columns of the matrix (6 numbers, smooth).
enum class RotationFeatures { euler, rotation_6d };

struct EgNetConfig {
  SagcnConfig sagcn;
  int past_frames = 2;       ///< F: past frames beside the current one
  double input_limit = 0.0;  ///< limit of the standardised inputs, standard deviations; 0: no limit
  /// Past frames that contribute to the nodes' inertia (EgNet::inertia); 0: no inertia, as in the thesis.
  int inertia = 0;
  int inertia_modes = 2;  ///< damped oscillations of the inertia
  NodeFeatures node_features = NodeFeatures::graph;
  RotationFeatures rotation = RotationFeatures::euler;
  /// Blend A_b(theta) A_b(rest)^-1 (identity in the rest pose), or A_b(theta) alone, as one public checkpoint requires.
  bool rest_inverse = true;
  NetworkKind network = NetworkKind::sagcn;  ///< the others are baselines of Table 6.4
  AblationConfig ablation;
  static EgNetConfig preset(const std::string& name);

  /// @throws UsageError listing every fault
  void check() const;
  /// Numbers per node and frame: 6 or 9.
  int features_per_frame() const { return rotation == RotationFeatures::euler ? 6 : 9; }
  /// P: past frames required beside the current one.
  int history() const { return std::max(past_frames, inertia); }
  /// Numbers per node in the window.
  int num_inputs() const { return features_per_frame() * (past_frames + 1); }
};
void describe_keys(const Keys& keys, EgNetConfig& config);

class EgNetImpl : public torch::nn::Module {
 public:
  /// @param generator draws the initial kernels; by default a fresh one with a fixed seed
  EgNetImpl(const Character& character, const EgNetConfig& config,
            std::optional<at::Generator> generator = std::nullopt);

  /// @param dof_window [B,P+1,D] or longer, oldest first, world DoFs as in a motion file
  /// @return A [B,K,3] Euler angles and T [B,K,3] metres, in canonical pose
  std::pair<torch::Tensor, torch::Tensor> forward(const torch::Tensor& dof_window) {
    return forward(dof_window, dof_window);
  }
  /// The same with other poses as input of the network than those of `dof_window`: in training, poses with noise.
  /// Inertia is computed from `dof_window`.
  std::pair<torch::Tensor, torch::Tensor> forward(const torch::Tensor& seen_window, const torch::Tensor& dof_window);

  /// The lag of the nodes behind their bones, a part of T: sum_j w_k(j) R_k^T (x_k(t-j) - x_k(t)) over the past frames
  /// j, with x_k(t) the skinned node and R_k its skinned rotation at t. The response of a damped spring to its path is
  /// linear and does not depend on the pose, so w_k(j) = sum_m exp(-lambda_m j) (a_km cos(mu_m j) + b_km sin(mu_m j)).
  /// The rates lambda and frequencies mu are learnt for the whole body, a and b for each node. Few frames suffice for
  /// this. Not in the thesis.
  /// @param dof_window [B,P+1,D] or longer @return [B,K,3] metres, canonical
  /// @throws Error where the model has no inertia
  torch::Tensor inertia(const torch::Tensor& dof_window);

  /// The network's input before standardisation: `node_features`; with `network: fully_connected`, the normalised DoFs
  /// as one row. @return [B,K,Hin], or [B,1,D(F+1)]
  torch::Tensor network_input(const torch::Tensor& dof_window);
  /// The features of each node: [T, rotation] of each frame, one frame after the other. @return [B,K,Hin]
  torch::Tensor node_features(const torch::Tensor& dof_window);

  /// Sets the standardisation (x - mean) / std of the input; identity until called. Saved with the model.
  /// @param mean, std of the shape of one item of `network_input` (or of its last dimension); a std below `floor` is
  /// set to `floor`, so that a feature that is constant in the training set cannot explode for an unseen pose
  void set_input_statistics(const torch::Tensor& mean, const torch::Tensor& std, double floor = 1e-3);

  const EgNetConfig& config() const { return config_; }
  int64_t num_nodes() const { return num_nodes_; }

 private:
  torch::Tensor bone_transforms(const torch::Tensor& dofs);
  torch::Tensor node_transforms(const torch::Tensor& dof_window);
  torch::Tensor inertia_weights() const;

  EgNetConfig config_;
  MotionWindow window_;
  int64_t num_nodes_;
  Kinematics kinematics_{nullptr};
  Skinning node_skinning_{nullptr};
  std::shared_ptr<GraphNetwork> network_;
  torch::Tensor input_mean_, input_std_;
  torch::Tensor inertia_gain_;                       // [2*modes*K] as one row: weights decay, gains must not
  torch::Tensor inertia_decay_, inertia_frequency_;  // [modes], per frame: log of the rate; radians
  torch::Tensor node_positions_, bone_joint_;
};
TORCH_MODULE(EgNet);

}  // namespace doppel
