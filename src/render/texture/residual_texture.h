#pragma once

#include <torch/types.h>

namespace doppel {

/// A texture plus what a network adds to it (6.8 with a residual):
///
///   t = clamp(a * L(n) + tanh(r), 0, 1),   L(n) = lighting . sh_basis(n), or 1 without lighting
///
/// T is the size of the maps. Without gradient; float32 on the CPU.
/// @param residual [B,3,T,T] r  @param albedo [1,3,T,T] a
/// @param normals [B,3,T,T] n, unit or 0, may be a slice of channels  @param lighting [3,9]; both undefined: unlit
/// @return [B,T,T,3]
torch::Tensor residual_texture(const torch::Tensor& residual, const torch::Tensor& albedo, const torch::Tensor& normals,
                               const torch::Tensor& lighting);
/// The definition, in plain tensor operations; differentiable, any dtype, traceable. The gradient ignores the clamping:
/// otherwise a texel outside the range would get no gradient.
torch::Tensor residual_texture_reference(const torch::Tensor& residual, const torch::Tensor& albedo,
                                         const torch::Tensor& normals, const torch::Tensor& lighting);
/// The same of a larger texture, whose details stay:
///
///   t = clamp(a * U(L(n)) + U(tanh(r)), 0, 1)
///
/// U enlarges T texels along a side to T', bilinearly. Only texels with a normal count in U(L(n)), so that the borders
/// of the charts have the lighting of their inside. In plain tensor operations; differentiable as above, any dtype.
/// @param residual [B,3,T,T] r @param albedo [1,3,T',T'] a @param normals [B,3,T,T] n @param lighting [3,9]
/// @return [B,T',T',3]
torch::Tensor detailed_texture(const torch::Tensor& residual, const torch::Tensor& albedo, const torch::Tensor& normals,
                               const torch::Tensor& lighting);

}  // namespace doppel
