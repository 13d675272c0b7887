#pragma once

/// DeltaNet (6.7.1): from a motion window to a displacement of every vertex of the template.

#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include <optional>
#include <string>

#include "doppel/character/character.h"
#include "doppel/core/options.h"
#include "doppel/layers/surface.h"
#include "doppel/nets/motion_graph_net.h"

namespace doppel {

/// The space of the displacements: on the template before it is posed (6.14), or on the posed surface, in axes that
/// turn with the heading (an ablation of Table 6.4).
enum class DisplacementSpace { canonical, global };

struct DeltaNetConfig : MotionGraphConfig {
  DisplacementSpace space = DisplacementSpace::canonical;
};
void describe_keys(const Keys& keys, DeltaNetConfig& config);

/// The outputs are the displacements D [B,N,3], metres.
class DeltaNetImpl : public MotionGraphNetImpl {
 public:
  /// @param generator draws the initial kernels; by default a fresh one with a fixed seed
  DeltaNetImpl(const Character& character, const DeltaNetConfig& config,
               std::optional<at::Generator> generator = std::nullopt);

  /// V_fi: the deformed and posed surface with the displacements in their space. Equation: 6.14
  /// @param A, T [B,K,3] of EGNet for the same window @param D [B,N,3] result of `forward`
  /// @return [B,N,3] world metres
  torch::Tensor displaced(CharacterSurface& surface, const torch::Tensor& dof_window, const torch::Tensor& A,
                          const torch::Tensor& T, const torch::Tensor& D);

  const DeltaNetConfig& config() const { return config_; }

 private:
  DeltaNetConfig config_;
};
TORCH_MODULE(DeltaNet);

}  // namespace doppel
