#pragma once

/// From a motion window to values at every vertex of the template: the common part of DeltaNet (6.7.1) and the motion
/// features of the radiance field (f_gr of 6.25).

#include <torch/nn/module.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include <memory>
#include <optional>
#include <string>

#include "doppel/character/character.h"
#include "doppel/core/options.h"
#include "doppel/layers/kinematics/kinematics.h"
#include "doppel/layers/skinning/skinning.h"
#include "doppel/nets/ablation_nets.h"
#include "doppel/nets/motion_window.h"

namespace doppel {

/// Whether the network knows which way the person faces. `removed`: the window of 6.4 for geometry, M hat. `kept`: the
/// window of 6.4 for the texture, M tilde, for colours under lighting that is fixed in the world.
enum class Heading { removed, kept };

struct MotionGraphConfig {
  SagcnConfig sagcn;    ///< of the template's mesh graph
  int past_frames = 2;  ///< F: past frames beside the current one
  Heading heading = Heading::removed;
  double input_limit = 0.0;  ///< limit of the standardised inputs, standard deviations; 0: no limit
  NetworkKind network = NetworkKind::sagcn;
  AblationConfig ablation;

  /// 16 features, 8 residual blocks, R = 3, broadcast dense block, no batch normalisation.
  MotionGraphConfig();

  /// @throws UsageError listing every fault
  void check() const;
};
void describe_keys(const Keys& keys, MotionGraphConfig& config);

/// The template's vertices at rest. @return float64 [N,3], metres
torch::Tensor rest_vertices(const Character& character);

class MotionGraphNetImpl : public torch::nn::Module {
 public:
  /// @param name of the network, for messages
  /// @param outputs per vertex
  /// @param generator draws the initial kernels; by default a fresh one with a fixed seed
  MotionGraphNetImpl(const std::string& name, const Character& character, const MotionGraphConfig& config, int outputs,
                     std::optional<at::Generator> generator = std::nullopt);

  /// @param dof_window [B,F+1,D], oldest first, world DoFs as in a motion file
  /// @return [B,N,outputs]
  torch::Tensor forward(const torch::Tensor& dof_window);

  /// The network's input before standardisation: for each vertex its positions on the template posed by each frame of
  /// the normalised window, one frame after the other, metres. With `network: fully_connected`, the normalised DoFs as
  /// one row.
  /// @return [B,N,3(F+1)], or [B,1,D(F+1)]
  torch::Tensor network_input(const torch::Tensor& dof_window);

  /// Sets the standardisation (x - mean) / std of this input; identity until called. Saved with the model.
  /// @param mean, std of the shape of one item of `network_input` (or of its last dimension); a std below `floor` is
  /// set to `floor`, so that a vertex that does not move in the training set cannot explode for an unseen pose
  void set_input_statistics(const torch::Tensor& mean, const torch::Tensor& std, double floor = 1e-3);

  int64_t num_vertices() const { return num_vertices_; }

 protected:
  const MotionWindow& motion_window() const { return window_; }

 private:
  std::string name_;
  MotionGraphConfig config_;
  MotionWindow window_;
  int64_t num_vertices_;
  Kinematics kinematics_{nullptr};
  Skinning skinning_{nullptr};
  std::shared_ptr<GraphNetwork> network_;
  torch::Tensor input_mean_, input_std_;
  torch::Tensor rest_, rest_float_;  ///< float64 and float32 [N,3]
};
TORCH_MODULE(MotionGraphNet);

}  // namespace doppel
