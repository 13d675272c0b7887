#include "doppel/render/splats/surface_frames.h"

#include "doppel/core/tensor/checks.h"

namespace doppel {
namespace {

using torch::Tensor;

Tensor sum_of_products(const Tensor& a, const Tensor& b) { return (a * b).sum(-1, true); }

/// Unit quaternions of rotation matrices with the columns x, y, z [...,3]: of four formulas, the one whose divisor is
/// the largest.
Tensor quaternions(const Tensor& x, const Tensor& y, const Tensor& z) {
  const auto m = [](const Tensor& column, int row) { return column.select(-1, row); };
  const Tensor xx = m(x, 0), yy = m(y, 1), zz = m(z, 2);
  const Tensor a = m(y, 2) - m(z, 1), b = m(z, 0) - m(x, 2), c = m(x, 1) - m(y, 0);
  const Tensor ab = m(y, 0) + m(x, 1), ac = m(z, 0) + m(x, 2), bc = m(z, 1) + m(y, 2);
  const Tensor four = torch::stack({1 + xx + yy + zz, 1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz}, -1);
  const Tensor all = torch::stack(
      {torch::stack({four.select(-1, 0), a, b, c}, -1), torch::stack({a, four.select(-1, 1), ab, ac}, -1),
       torch::stack({b, ab, four.select(-1, 2), bc}, -1), torch::stack({c, ac, bc, four.select(-1, 3)}, -1)},
      -2);  // [...,4,4], each row is the quaternion times a divisor
  const Tensor best = four.argmax(-1, true).unsqueeze(-1).expand_as(all.narrow(-2, 0, 1));
  return unit_vectors(all.gather(-2, best).squeeze(-2));
}

Tensor at_corner(const Tensor& values, const TexelPoints& points, int k) {
  return values.index_select(1, points.corners.select(1, k).contiguous());
}

}  // namespace

Tensor unit_vectors(const Tensor& vectors) { return vectors / vectors.norm(2, -1, true).clamp_min(1e-12); }

Tensor at_points(const Tensor& values, const TexelPoints& points) {
  const Tensor weights = points.weights.to(values.scalar_type());
  Tensor sum = at_corner(values, points, 0) * weights.select(1, 0).unsqueeze(1);
  for (int k = 1; k < 3; ++k) sum = sum + at_corner(values, points, k) * weights.select(1, k).unsqueeze(1);
  return sum;
}

SurfaceFrames surface_frames(const Tensor& vertices, const RenderMesh& mesh, const TexelPoints& points) {
  check_shape("surface_frames", "vertices", vertices, {-1, mesh.num_vertices, 3}, "[B,N,3]");
  return surface_frames(vertices, vertex_normal_sums(vertices, mesh), points);
}

SurfaceFrames surface_frames(const Tensor& vertices, const Tensor& normal_sums, const TexelPoints& points) {
  const Tensor normal = unit_vectors(at_points(normal_sums, points));
  const Tensor edge = at_corner(vertices, points, 1) - at_corner(vertices, points, 0);
  const Tensor tangent = unit_vectors(edge - normal * sum_of_products(normal, edge));
  return {at_points(vertices, points), quaternions(tangent, torch::cross(normal, tangent, -1), normal), normal};
}

Tensor quaternion_product(const Tensor& a, const Tensor& b) {
  const Tensor s = a.narrow(-1, 0, 1), t = b.narrow(-1, 0, 1), u = a.narrow(-1, 1, 3), v = b.narrow(-1, 1, 3);
  const auto [left, right] = std::pair(u.expand_as(v + u), v.expand_as(v + u));
  return torch::cat({s * t - sum_of_products(u, v), s * v + t * u + torch::cross(left, right, -1)}, -1);
}

Tensor turned(const Tensor& rotations, const Tensor& vectors) {
  const Tensor axis = rotations.narrow(-1, 1, 3);
  const Tensor v = vectors.expand_as(axis), c = 2 * torch::cross(axis, v, -1);
  return v + rotations.narrow(-1, 0, 1) * c + torch::cross(axis, c, -1);
}

}  // namespace doppel
