#include "doppel/eval/surface_metrics.h"

#include <ATen/Parallel.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "doppel/core/tensor/checks.h"

namespace doppel {

namespace {

using Eigen::Vector3d;

TriangleTree tree_of(const torch::Tensor& vertices_in, const torch::Tensor& faces_in) {
  check_floats("surface distance", "vertices", vertices_in, {-1, 3}, "[N,3]");
  check_tensor("surface distance", "faces", faces_in, {torch::kInt32}, {-1, 3}, "[F,3]");
  const torch::Tensor vertices = vertices_in.contiguous(), faces = faces_in.contiguous();
  const float* v = vertices.data_ptr<float>();
  const int* f = faces.data_ptr<int>();
  std::vector<Vector3d> positions;
  for (std::int64_t i = 0; i < vertices.size(0); ++i, v += 3) positions.emplace_back(v[0], v[1], v[2]);
  std::vector<Triangle> triangles;
  for (std::int64_t i = 0; i < faces.size(0); ++i, f += 3) triangles.push_back({f[0], f[1], f[2]});
  return TriangleTree(positions, triangles);
}

}  // namespace

SurfaceDistance::SurfaceDistance(const torch::Tensor& vertices, const torch::Tensor& faces)
    : tree_(tree_of(vertices, faces)) {}

torch::Tensor SurfaceDistance::distances(const torch::Tensor& points_in) const {
  check_floats("surface distance", "points", points_in, {-1, 3}, "[M,3]");
  const torch::Tensor points = points_in.contiguous();
  torch::Tensor result = torch::empty({points.size(0)}, torch::kFloat64);
  const float* from = points.data_ptr<float>();
  double* to = result.data_ptr<double>();
  at::parallel_for(0, points.size(0), 256, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t i = begin; i < end; ++i) {
      const Vector3d point(from[3 * i], from[3 * i + 1], from[3 * i + 2]);
      to[i] = std::sqrt(tree_.closest(point).squared_distance);
    }
  });
  return result;
}

SurfaceGap surface_gap(const torch::Tensor& a, const torch::Tensor& a_faces, const torch::Tensor& b,
                       const torch::Tensor& b_faces) {
  const torch::Tensor to_b = SurfaceDistance(b, b_faces).distances(a);
  const torch::Tensor to_a = SurfaceDistance(a, a_faces).distances(b);
  SurfaceGap gap;
  gap.from_a = to_b;
  gap.hausdorff = std::max(to_a.max().item<double>(), to_b.max().item<double>());
  gap.mean = 0.5 * (to_a.mean().item<double>() + to_b.mean().item<double>());
  return gap;
}

}  // namespace doppel
