#pragma once

/// Skinning: moves points with a weighted blend of bone transforms.
///
///   linear:          x_i' = sum_b w_ib (R_b x_i + t_b)
///   dual_quaternion: x_i' = M_i x_i,  M_i = the rigid transform of  sum_b s_ib w_ib dq_b,
///                    normalised by its real part;
///                    s_ib = +-1 aligns the sign of bone b with that of the vertex's first (largest) bone.
///
/// Letters: B batch, N points, Bn bones. Metres.

#include <torch/nn/module.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include "doppel/character/character.h"
#include "doppel/layers/sparse_rows.h"

namespace doppel {

/// Skinned points.
/// @param points  [N,3] shared by the batch, or [B,N,3]
/// @param bones   [B,Bn,3,4] rigid transforms
/// @return [B,N,3]
/// Gradients: to points (summed over the batch if shared) and to bones. The sign s_ib is constant. The gradient to a
/// rotation matrix is that of its conversion to a quaternion: exact for changes that keep the matrix a rotation,
/// arbitrary for others. No second derivative.
/// @throws Error naming the argument, with the shape found
torch::Tensor skinning(const torch::Tensor& points, const torch::Tensor& bones, const SparseRows& weights,
                       SkinningMode mode);
/// The blended transform of each point, [B,N,3,4]. With `linear` it is generally not rigid.
torch::Tensor skinning_blend(const torch::Tensor& bones, const SparseRows& weights, SkinningMode mode);

/// The same in plain tensor operations: any device and float type, traceable.
torch::Tensor skinning_reference(const torch::Tensor& points, const torch::Tensor& bones, const SparseRows& weights,
                                 SkinningMode mode);
torch::Tensor skinning_blend_reference(const torch::Tensor& bones, const SparseRows& weights, SkinningMode mode);

/// The skinning weights of the graph nodes: node k has those of its template vertex.
SkinningWeights node_skinning_weights(const Character& character);

/// Skinning with fixed weights.
class SkinningImpl : public torch::nn::Module {
 public:
  explicit SkinningImpl(const SkinningWeights& weights, SkinningMode mode = SkinningMode::dual_quaternion);

  torch::Tensor forward(const torch::Tensor& points, const torch::Tensor& bones) const;
  torch::Tensor blend(const torch::Tensor& bones) const;

  const SparseRows& weights() const { return weights_; }
  void pretty_print(std::ostream& stream) const override;

 private:
  SparseRows weights_;
  SkinningMode mode_;
};
TORCH_MODULE(Skinning);

}  // namespace doppel
