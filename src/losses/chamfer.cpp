#include "doppel/losses/chamfer.h"

#include <ATen/Parallel.h>

#include <vector>

#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"
#include "doppel/geometry/triangle_tree.h"
#include "doppel/layers/closest_point/closest_point.h"

namespace doppel {

using torch::Tensor;

namespace {

/// Rows of `positions` [M,3] nearest to each of `points` [P,3], both finite. @return int64 [P]
Tensor nearest_rows(const Tensor& points, const Tensor& positions) {
  std::vector<Triangle> dots;  // a triangle without extent is a point
  for (int i = 0; i < static_cast<int>(positions.size(0)); ++i) dots.push_back({i, i, i});
  const TriangleTree tree(positions_of(positions), dots);
  const std::vector<Eigen::Vector3d> from = positions_of(points);
  const Tensor nearest = torch::empty({points.size(0)}, torch::kInt64);
  at::parallel_for(0, points.size(0), 128, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) nearest.data_ptr<int64_t>()[i] = tree.closest(from[i]).face;
  });
  return nearest.to(points.device());
}

/// Mean of eta over pairs. A pair whose normals `agree` [P] less than the options require counts as 0.
Tensor robust_mean(const Tensor& offset, const Tensor& agree, const ChamferOptions& options) {
  const Tensor squared = offset.square().sum(1);
  const Tensor counts = (squared <= options.threshold * options.threshold) & (agree >= options.min_agreement);
  return torch::where(counts, squared, torch::zeros_like(squared)).mean();
}

}  // namespace

Tensor point_cloud(const RenderedRays& rays, const Tensor& origin, const Tensor& direction, double min_opacity) {
  check_shape("point_cloud", "direction", direction, {rays.depth.size(0), 3}, "[R,3]");
  const torch::NoGradGuard no_grad;
  const Tensor seen = (rays.opacity > min_opacity).nonzero().squeeze(1);
  return (origin + rays.depth.unsqueeze(1) * direction).index_select(0, seen);
}

Tensor chamfer_loss(const Tensor& vertices, const Tensor& normals, const PointCloud& cloud_in, const Tensor& visible,
                    const ChamferOptions& options) {
  constexpr const char* kName = "chamfer_loss";
  check_shape(kName, "vertices", vertices, {-1, 3}, "[N,3]");
  check_shape(kName, "normals", normals, {vertices.size(0), 3}, "[N,3]");
  check_shape(kName, "cloud's points", cloud_in.points, {-1, 3}, "[R,3]");
  check_shape(kName, "cloud's normals", cloud_in.normals, {cloud_in.points.size(0), 3}, "[R,3]");
  check_same_kind(kName, "cloud", cloud_in.points, vertices);
  if (visible.defined()) check_tensor(kName, "visible", visible, {torch::kBool}, vertices.sizes().slice(0, 1), "[N]");
  for (const Tensor& points : {vertices, cloud_in.points})
    if (!points.isfinite().all().item<bool>())
      fail<UsageError>("{}: vertices or cloud have numbers that are not finite; check how they were computed", kName);
  const Tensor cloud = cloud_in.points.detach();
  // The gradient of an embedding sums rows much faster than that of an index.
  Tensor shown = vertices, towards = normals;
  if (visible.defined()) {
    const Tensor rows = visible.nonzero().squeeze(1);
    shown = torch::embedding(vertices, rows);
    towards = normals.index_select(0, rows);
  }
  if (shown.size(0) == 0 || cloud.size(0) == 0) return vertices.sum() * 0.0;
  const Tensor of_points = nearest_rows(cloud, shown), of_vertices = nearest_rows(shown, cloud);
  const Tensor to_vertices = torch::embedding(shown, of_points) - cloud,
               to_points = shown - cloud.index_select(0, of_vertices);
  return robust_mean(to_vertices, (cloud_in.normals * towards.index_select(0, of_points)).sum(1), options) +
         robust_mean(to_points, (towards * cloud_in.normals.index_select(0, of_vertices)).sum(1), options);
}

}  // namespace doppel
