#pragma once

/// The character's surface as a function of pose and deformation: joins kinematics, skinning and embedded deformation.

#include <torch/nn/module.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include <optional>

#include "doppel/character/character.h"
#include "doppel/layers/embedded_deformation/embedded_deformation.h"
#include "doppel/layers/kinematics/kinematics.h"
#include "doppel/layers/skinning/skinning.h"

namespace doppel {

class CharacterSurfaceImpl : public torch::nn::Module {
 public:
  /// @param mode of vertices and nodes. By default vertices have the mode of the character and nodes blend dual
  ///   quaternions.
  explicit CharacterSurfaceImpl(const Character& character, std::optional<SkinningMode> mode = std::nullopt);

  /// Pure skinning, each vertex with its own blend of bones. @param dofs [B,D] @return [B,N,3] world metres
  torch::Tensor skinned(const torch::Tensor& dofs);
  /// Pure skinning through the graph nodes: the result of `deformed` without deformation. @return [B,N,3]
  torch::Tensor skinned_by_nodes(const torch::Tensor& dofs);
  /// Embedded deformation, then node-level skinning. Equations: 6.2, 6.3
  /// @param A, T [B,K,3] @param D [B,N,3] or undefined @return [B,N,3] world metres
  torch::Tensor deformed(const torch::Tensor& dofs, const torch::Tensor& A, const torch::Tensor& T,
                         const torch::Tensor& D = {});
  /// [B,K,3,4] skinning transforms of the graph nodes; the identity in the rest pose.
  torch::Tensor node_transforms(const torch::Tensor& dofs);

  const Kinematics& kinematics() const { return kinematics_; }
  const EmbeddedDeformation& embedded_deformation() const { return embedded_deformation_; }

 private:
  Kinematics kinematics_;
  Skinning vertex_skinning_, node_skinning_;
  EmbeddedDeformation embedded_deformation_;
  torch::Tensor rest_, rest_float_;  ///< float64 and float32 [N,3]
};
TORCH_MODULE(CharacterSurface);

}  // namespace doppel
