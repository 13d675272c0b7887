#pragma once

/// DeltaNet (6.7.1): from a window of poses to a displacement of every vertex of the template.

#include <torch/torch.h>

#include <memory>
#include <optional>
#include <string>

#include "doppel/character/character.h"
#include "doppel/core/config.h"
#include "doppel/layers/kinematics/kinematics.h"
#include "doppel/layers/skinning/skinning.h"
#include "doppel/layers/surface.h"
#include "doppel/nets/ablation_nets.h"
#include "doppel/nets/motion_window.h"

namespace doppel {

/// Where displacements live: on the template before it is posed (6.14), or on the posed surface, in axes that turn with
/// the heading (an ablation of Table 6.4).
enum class DisplacementSpace { canonical, global };

struct DeltaNetConfig {
  SagcnConfig sagcn;         ///< of the template's mesh graph
  int window = 2;            ///< F: past frames beside the current one
  double input_limit = 0.0;  ///< standardised inputs are held within this many standard deviations; 0: not at all
  DisplacementSpace space = DisplacementSpace::canonical;
  NetworkKind network = NetworkKind::sagcn;
  AblationConfig ablation;

  /// `paper`: 16 features, 8 residual blocks, R = 3, broadcast dense block, no batch normalisation.
  static DeltaNetConfig preset(const std::string& name);
  /// Keys: `preset: paper`, then anything to change in it: `window`, `space`, `network`, those of SagcnConfig and of
  /// AblationConfig. @throws FileError at the key
  static DeltaNetConfig read(const ConfigReader& reader);
  /// @throws UsageError listing every fault
  void check() const;
};

class DeltaNetImpl : public torch::nn::Module {
 public:
  /// @param generator draws the initial kernels; by default a fresh one with a fixed seed
  DeltaNetImpl(const Character& character, const DeltaNetConfig& config,
               std::optional<at::Generator> generator = std::nullopt);

  /// @param dof_window [B,F+1,D], oldest first, world DoFs as in a motion file
  /// @return D [B,N,3] metres
  torch::Tensor forward(const torch::Tensor& dof_window);

  /// V_fi: the deformed and posed surface with the displacements in their space. Equation: 6.14
  /// @param A, T [B,K,3] of EGNet for the same window @param D [B,N,3] what `forward` returned
  /// @return [B,N,3] world metres
  torch::Tensor displaced(CharacterSurface& surface, const torch::Tensor& dof_window, const torch::Tensor& A,
                          const torch::Tensor& T, const torch::Tensor& D);

  /// The network's input before standardisation: the template posed by each frame of the normalised window, per vertex
  /// frame after frame, metres. With network: fully_connected, the normalised DoFs as one row.
  /// @return [B,N,3(F+1)], or [B,1,D(F+1)]
  torch::Tensor network_input(const torch::Tensor& dof_window);

  /// Fixes the standardisation (x - mean) / std of that input; identity until called. Saved with the model.
  /// @param mean, std of the shape of one item of `network_input` (or of its last dimension); a std below `floor` is
  /// raised to it, so that a vertex that does not move in the training set cannot explode on an unseen pose
  void set_input_statistics(const torch::Tensor& mean, const torch::Tensor& std, double floor = 1e-3);

  const DeltaNetConfig& config() const { return config_; }
  int64_t num_vertices() const { return num_vertices_; }

 private:
  DeltaNetConfig config_;
  MotionWindow window_;
  int64_t num_vertices_;
  Kinematics kinematics_{nullptr};
  Skinning skinning_{nullptr};
  std::shared_ptr<GraphNetwork> network_;
  torch::Tensor input_mean_, input_std_;
  torch::Tensor rest_, rest_float_;  ///< float64 and float32 [N,3]
};
TORCH_MODULE(DeltaNet);

}  // namespace doppel
