#include "doppel/layers/surface.h"

#include "doppel/layers/transform_math.h"

namespace doppel {

CharacterSurfaceImpl::CharacterSurfaceImpl(const Character& character, std::optional<SkinningMode> mode)
    : torch::nn::Module("CharacterSurface"),
      kinematics_(register_module("kinematics", Kinematics(character))),
      vertex_skinning_(register_module("vertex_skinning", Skinning(character.skin, mode.value_or(character.skinning)))),
      node_skinning_(register_module(
          "node_skinning", Skinning(node_skinning_weights(character), mode.value_or(SkinningMode::dual_quaternion)))),
      embedded_deformation_(register_module("embedded_deformation", EmbeddedDeformation(character))),
      rest_(embedded_deformation_->graph().rest),
      rest_float_(rest_.to(torch::kFloat32)) {}

torch::Tensor CharacterSurfaceImpl::skinned(const torch::Tensor& dofs) {
  const torch::Tensor& rest = dofs.scalar_type() == torch::kFloat32 ? rest_float_ : rest_;
  return vertex_skinning_->forward(constant_like(rest, dofs), kinematics_->bones(dofs));
}

torch::Tensor CharacterSurfaceImpl::skinned_by_nodes(const torch::Tensor& dofs) {
  const torch::Tensor transforms = node_transforms(dofs);
  const torch::Tensor none = torch::zeros_like(translation_of(transforms));
  return embedded_deformation_->forward(none, none, {}, transforms);
}

torch::Tensor CharacterSurfaceImpl::deformed(const torch::Tensor& dofs, const torch::Tensor& A, const torch::Tensor& T,
                                             const torch::Tensor& D) {
  return embedded_deformation_->forward(A, T, D, node_transforms(dofs));
}

torch::Tensor CharacterSurfaceImpl::node_transforms(const torch::Tensor& dofs) {
  return node_skinning_->blend(kinematics_->bones(dofs));
}

}  // namespace doppel
