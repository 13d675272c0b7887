#pragma once

/// The hybrid of 6.12: a mesh that DeltaNet refines, and a radiance field that surrounds the mesh and takes its motion
/// features from it.

#include <torch/torch.h>

#include <optional>

#include "doppel/character/character.h"
#include "doppel/core/config.h"
#include "doppel/nets/delta_net.h"
#include "doppel/nets/motion_graph_net.h"
#include "doppel/nets/radiance_field.h"

namespace doppel {

struct HybridConfig {
  MotionGraphConfig motion;  ///< of the network that makes the features
  RadianceFieldConfig field;

  /// Features of some size from the first step on: the field could not tell vertices apart before.
  HybridConfig();
  /// Keys: `motion` (those of MotionGraphConfig) and `field` (those of RadianceFieldConfig).
  /// @throws FileError at the key
  static HybridConfig read(const ConfigReader& reader);
};

class HybridImpl : public torch::nn::Module {
 public:
  /// @param deltanet the displacements to begin with: both DeltaNets are copies of it
  /// @param generator draws the initial weights of field and features; by default a fresh one with a fixed seed
  HybridImpl(const Character& character, DeltaNet& deltanet, const HybridConfig& config,
             std::optional<at::Generator> generator = std::nullopt);

  /// Lets the field lie around the refined mesh from now on.
  void follow();

  /// What the vertices of a frame carry into the field. @param dof_window [1,F,D] that ends with the frame, of at least
  /// the features' window @return [N, field->config().vertex_values()], gradient to the features' network
  torch::Tensor vertex_values(const torch::Tensor& dof_window);

  const HybridConfig& config() const { return config_; }

  DeltaNet refined{nullptr};
  /// DeltaNet of the mesh that the field was trained around, which stays while `refined` moves; never trained itself.
  DeltaNet around{nullptr};
  MotionGraphNet motion{nullptr};  ///< f_gr: features [B,N,H]
  RadianceField field{nullptr};

 private:
  HybridConfig config_;
  torch::Tensor
      places_;  ///< [N,3] at rest, from the middle of their box, the largest 1; undefined without place_octaves
};
TORCH_MODULE(Hybrid);

}  // namespace doppel
