#pragma once

/// The hybrid of 6.12: a mesh that DeltaNet refines, and a radiance field around the mesh with motion features at the
/// mesh's vertices.

#include <torch/nn/module.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include <optional>

#include "doppel/character/character.h"
#include "doppel/core/options.h"
#include "doppel/nets/delta_net.h"
#include "doppel/nets/motion_graph_net.h"
#include "doppel/nets/radiance_field.h"

namespace doppel {

struct HybridConfig {
  /// Of the network for the motion features. The heading is kept (6.25), unlike in DeltaNet: the colours of a person
  /// who turns change with the lighting.
  MotionGraphConfig motion;
  RadianceFieldConfig field;

  /// Sets the defaults of 6.25, with larger initial features, so that the field can distinguish vertices from the first
  /// step on.
  HybridConfig();
};
void describe_keys(const Keys& keys, HybridConfig& config);

class HybridImpl : public torch::nn::Module {
 public:
  /// @param deltanet the initial displacements: both DeltaNets are copies of it
  /// @param generator draws the initial weights of field and features; by default a fresh one with a fixed seed
  HybridImpl(const Character& character, DeltaNet& deltanet, const HybridConfig& config,
             std::optional<at::Generator> generator = std::nullopt);

  /// Both DeltaNets stay in evaluation mode: a step has one frame, of which batch normalisation cannot take statistics.
  void train(bool on = true) override;

  /// Copies `refined` to `around`: the field surrounds the refined mesh from now on.
  void follow();

  /// The vertex values of a frame that the field interpolates.
  /// @param dof_window [1,F,D] that ends with the frame, at least as long as the motion window of the features
  /// @return [N, field->config().vertex_values()], gradient to the features' network
  torch::Tensor vertex_values(const torch::Tensor& dof_window);

  const HybridConfig& config() const { return config_; }

  DeltaNet refined{nullptr};
  /// DeltaNet of the mesh that the field was trained around. It is fixed while `refined` is trained.
  DeltaNet around{nullptr};
  MotionGraphNet motion{nullptr};  ///< f_gr: features [B,N,H]
  RadianceField field{nullptr};

 private:
  HybridConfig config_;
  torch::Tensor positions_;  ///< rest positions [N,3], centred, largest coordinate 1; undefined without place_octaves
};
TORCH_MODULE(Hybrid);

}  // namespace doppel
