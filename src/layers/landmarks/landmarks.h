#pragma once

/// Landmarks: points that detectors find in images, on a posed character (5.5.1) and on a deformed character (5.6.3).
/// Letters: B batch, D DoFs, M landmarks, K graph nodes. Metres.

#include <torch/nn/module.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include <vector>

#include "doppel/character/character.h"
#include "doppel/layers/embedded_deformation/embedded_deformation.h"
#include "doppel/layers/kinematics/kinematics.h"

namespace doppel {

/// Landmarks that are fixed to joints.
class LandmarksImpl : public torch::nn::Module {
 public:
  /// @throws UsageError for a landmark on a joint that the skeleton does not have
  LandmarksImpl(const Skeleton& skeleton, const std::vector<Marker>& landmarks);

  /// Positions in the world. With the DoFs of PoseDofs::root_relative they are relative to the unrotated root.
  /// @param dofs [B,D] @return [B,M,3]; gradient to `dofs` as forward_kinematics
  torch::Tensor forward(const torch::Tensor& dofs) const;

  int64_t size() const { return frames_.joint.size(0); }
  void pretty_print(std::ostream& stream) const override;

 private:
  KinematicChain chain_;
  RiddenFrames frames_;
};
TORCH_MODULE(Landmarks);

/// Rotates landmarks [B,M,3] by [B,3,3], for example from root-relative to world axes (5.1, without t).
torch::Tensor turn_points(const torch::Tensor& rotation, const torch::Tensor& points);

/// Landmarks that follow the embedded graph: each follows the node nearest to it in the rest pose, with weight 1.
/// Equation: 5.12 (their positions M_m)
class GraphLandmarksImpl : public torch::nn::Module {
 public:
  /// @throws Error as nearest_nodes
  GraphLandmarksImpl(const Character& character, const std::vector<Marker>& landmarks);

  /// @param A, T [B,K,3] of the nodes @param node_transforms [B,K,3,4] (CharacterSurface::node_transforms)
  /// @return [B,M,3] world; gradients to all three
  torch::Tensor forward(const torch::Tensor& A, const torch::Tensor& T, const torch::Tensor& node_transforms) const;

  const std::vector<int>& nodes() const { return nodes_; }  ///< [M] the node of each landmark

 private:
  std::vector<int> nodes_;
  EmbeddedDeformation deformation_{nullptr};
};
TORCH_MODULE(GraphLandmarks);

}  // namespace doppel
