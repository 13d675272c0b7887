#include "doppel/core/tensor/checks.h"
#include "doppel/layers/skinning/skinning.h"
#include "doppel/layers/transform_math.h"

namespace doppel {
namespace {

constexpr double kMinSquaredNorm = 1e-12;  // of a blended real part: 1e-6 squared

/// Unit quaternions (w,x,y,z) of rotation matrices [...,3,3]. Each row of `candidates` is the quaternion times four
/// times one of its components. The row of the largest component is well conditioned.
torch::Tensor quaternion_of(const torch::Tensor& rotation) {
  const auto m = [&](int row, int column) { return rotation.select(-2, row).select(-1, column); };
  const torch::Tensor x = m(2, 1) - m(1, 2), y = m(0, 2) - m(2, 0), z = m(1, 0) - m(0, 1);
  const torch::Tensor xy = m(0, 1) + m(1, 0), xz = m(0, 2) + m(2, 0), yz = m(1, 2) + m(2, 1);
  const torch::Tensor trace = m(0, 0) + m(1, 1) + m(2, 2);
  const auto diagonal = [&](int i) { return 1.0 + 2.0 * m(i, i) - trace; };
  const torch::Tensor candidates =
      torch::stack({torch::stack({1.0 + trace, x, y, z}, -1), torch::stack({x, diagonal(0), xy, xz}, -1),
                    torch::stack({y, xy, diagonal(1), yz}, -1), torch::stack({z, xz, yz, diagonal(2)}, -1)},
                   -2);
  const torch::Tensor largest = torch::stack({trace, m(0, 0), m(1, 1), m(2, 2)}, -1).argmax(-1, /*keepdim=*/true);
  const torch::Tensor row = largest.unsqueeze(-1).expand({-1, -1, 1, 4});
  const torch::Tensor chosen = candidates.gather(-2, row).squeeze(-2);
  return chosen / chosen.norm(2, {-1}, /*keepdim=*/true);
}

/// Dual quaternions [B,Bn,8] of rigid transforms [B,Bn,3,4]: real part q, dual part 1/2 (0,t) q.
torch::Tensor dual_quaternion_of(const torch::Tensor& transform) {
  const torch::Tensor real = quaternion_of(rotation_of(transform)), t = translation_of(transform);
  const torch::Tensor w = real.narrow(-1, 0, 1), v = real.narrow(-1, 1, 3);
  const torch::Tensor scalar = -(t * v).sum(-1, /*keepdim=*/true);
  const torch::Tensor vector = t * w + torch::cross(t, v, -1);
  return torch::cat({real, 0.5 * scalar, 0.5 * vector}, -1);
}

/// Rigid transforms [...,3,4] of dual quaternions [...,8] that need not be normalised.
torch::Tensor rigid_of(const torch::Tensor& dual_quaternion) {
  const auto part = [&](int i) { return dual_quaternion.select(-1, i); };
  const torch::Tensor w = part(0), x = part(1), y = part(2), z = part(3);
  const torch::Tensor s = 2.0 / (w * w + x * x + y * y + z * z).clamp_min(kMinSquaredNorm);
  const torch::Tensor ew = part(4), ex = part(5), ey = part(6), ez = part(7);
  const auto row = [](const torch::Tensor& a, const torch::Tensor& b, const torch::Tensor& c, const torch::Tensor& t) {
    return torch::stack({a, b, c, t}, -1);
  };
  // The translation is the vector part of 2 e conj(b) / |b|^2.
  return torch::stack({row(1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y),
                           s * (w * ex - ew * x + y * ez - z * ey)),
                       row(s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x),
                           s * (w * ey - ew * y + z * ex - x * ez)),
                       row(s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y),
                           s * (w * ez - ew * z + x * ey - y * ex))},
                      -2);
}

torch::Tensor blend_dual_quaternions(const torch::Tensor& bones, const SparseRows& weights) {
  const torch::Tensor items = index_like(weights.padded_items, bones);
  const torch::Tensor weight = constant_like(weights.padded_weights, bones).unsqueeze(-1);
  const torch::Tensor dual_quaternions = dual_quaternion_of(bones);
  const torch::Tensor first = dual_quaternions.index_select(1, items.select(1, 0));
  torch::Tensor sum = weight.select(1, 0) * first;
  for (int64_t p = 1; p < items.size(1); ++p) {
    const torch::Tensor term = dual_quaternions.index_select(1, items.select(1, p));
    const torch::Tensor cosine = (term.narrow(-1, 0, 4) * first.narrow(-1, 0, 4)).sum(-1, /*keepdim=*/true).detach();
    const torch::Tensor sign = 1.0 - 2.0 * (cosine < 0.0).to(bones.scalar_type());
    sum = sum + sign * weight.select(1, p) * term;
  }
  return rigid_of(sum);
}

}  // namespace

torch::Tensor skinning_blend_reference(const torch::Tensor& bones, const SparseRows& weights, SkinningMode mode) {
  check_shape("skinning", "bones", bones, {-1, weights.num_columns, 3, 4}, "[B,Bn,3,4]");
  return mode == SkinningMode::linear ? blend_transforms(bones, weights) : blend_dual_quaternions(bones, weights);
}

torch::Tensor skinning_reference(const torch::Tensor& points, const torch::Tensor& bones, const SparseRows& weights,
                                 SkinningMode mode) {
  const bool shared = points.defined() && points.dim() == 2;
  if (shared) {
    check_shape("skinning", "points", points, {weights.num_rows, 3}, "[N,3]");
  } else {
    check_shape("skinning", "points", points, {-1, weights.num_rows, 3}, "[B,N,3]");
  }
  return transform_points(skinning_blend_reference(bones, weights, mode), points);
}

}  // namespace doppel
