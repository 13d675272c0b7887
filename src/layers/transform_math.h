#pragma once

/// Rigid transforms as [...,3,4] tensors, in plain tensor operations that a torch::jit trace can hold.

#include <torch/types.h>

namespace doppel {

/// A constant on the device and in the type of `like`. If it already has both, it is returned unchanged, and a trace
/// records nothing.
inline torch::Tensor constant_like(const torch::Tensor& constant, const torch::Tensor& like) {
  if (constant.device() == like.device() && constant.scalar_type() == like.scalar_type()) return constant;
  return constant.to(like.options());
}
/// An index on the device of `like`.
inline torch::Tensor index_like(const torch::Tensor& index, const torch::Tensor& like) {
  if (index.device() == like.device() && index.scalar_type() == torch::kInt64) return index;
  return index.to(like.device(), torch::kInt64);
}

inline torch::Tensor rotation_of(const torch::Tensor& transform) { return transform.narrow(-1, 0, 3); }
inline torch::Tensor translation_of(const torch::Tensor& transform) { return transform.select(-1, 3); }
inline torch::Tensor make_transform(const torch::Tensor& rotation, const torch::Tensor& translation) {
  return torch::cat({rotation, translation.unsqueeze(-1)}, -1);
}

/// a_from_b * b_from_c.
inline torch::Tensor compose(const torch::Tensor& a_from_b, const torch::Tensor& b_from_c) {
  return torch::matmul(rotation_of(a_from_b), b_from_c) + torch::constant_pad_nd(a_from_b.narrow(-1, 3, 1), {3, 0});
}

/// Transforms points [...,3].
inline torch::Tensor transform_points(const torch::Tensor& transform, const torch::Tensor& points) {
  return (rotation_of(transform) * points.unsqueeze(-2)).sum(-1) + translation_of(transform);
}

}  // namespace doppel
