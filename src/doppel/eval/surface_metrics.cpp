#include "doppel/eval/surface_metrics.h"

#include <ATen/Parallel.h>
#include <torch/torch.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>
#include <numeric>

#include "doppel/core/error.h"

namespace doppel {

namespace {

using Eigen::Vector3d;

constexpr int kLeafTriangles = 4;
/// Boxes halve the number of triangles level by level; no tree of int-indexed triangles is deeper.
constexpr int kMaxDepth = 64;

void check_mesh(const torch::Tensor& vertices, const torch::Tensor& faces) {
  if (vertices.dim() != 2 || vertices.size(1) != 3 || vertices.scalar_type() != torch::kFloat32)
    fail<UsageError>("surface distance: vertices must be float32 [N,3], found {} {}",
                     torch::toString(vertices.scalar_type()), fmt::join(vertices.sizes(), "x"));
  if (faces.dim() != 2 || faces.size(1) != 3 || faces.scalar_type() != torch::kInt32 || faces.size(0) == 0)
    fail<UsageError>("surface distance: faces must be int32 [F,3] with at least one face, found {} {}",
                     torch::toString(faces.scalar_type()), fmt::join(faces.sizes(), "x"));
  const int low = faces.min().item<int>(), high = faces.max().item<int>();
  if (low < 0 || high >= vertices.size(0))
    fail<UsageError>("surface distance: a face names vertex {}, but there are {}", low < 0 ? low : high,
                     vertices.size(0));
}

double to_segment(const Vector3d& p, const Vector3d& a, const Vector3d& b) {
  const Vector3d along = b - a;
  const double length = along.squaredNorm();
  const double t = length > 0.0 ? std::clamp((p - a).dot(along) / length, 0.0, 1.0) : 0.0;
  return (p - a - t * along).squaredNorm();
}

}  // namespace

double squared_distance_to_triangle(const Vector3d& p, const std::array<Vector3d, 3>& t) {
  const Vector3d normal = (t[1] - t[0]).cross(t[2] - t[0]);
  const double area = normal.squaredNorm();
  bool inside = area > 0.0;
  for (int k = 0; k < 3 && inside; ++k) {
    const Vector3d &a = t[static_cast<std::size_t>(k)], &b = t[static_cast<std::size_t>((k + 1) % 3)];
    inside = (b - a).cross(p - a).dot(normal) >= 0.0;
  }
  if (inside) {
    const double height = (p - t[0]).dot(normal);
    return height * height / area;
  }
  return std::min({to_segment(p, t[0], t[1]), to_segment(p, t[1], t[2]), to_segment(p, t[2], t[0])});
}

double SurfaceDistance::Box::squared_distance(const Vector3d& point) const {
  return (low - point).cwiseMax(point - high).cwiseMax(Vector3d::Zero()).squaredNorm();
}

SurfaceDistance::SurfaceDistance(const torch::Tensor& vertices_in, const torch::Tensor& faces_in) {
  check_mesh(vertices_in, faces_in);
  const torch::Tensor vertices = vertices_in.contiguous(), faces = faces_in.contiguous();
  const float* positions = vertices.data_ptr<float>();
  const int* corners = faces.data_ptr<int>();
  const auto count = static_cast<int>(faces.size(0));
  std::vector<std::array<Vector3d, 3>> unordered(static_cast<std::size_t>(count));
  for (int i = 0; i < 3 * count; ++i) {
    const float* v = positions + 3 * static_cast<std::int64_t>(corners[i]);
    unordered[static_cast<std::size_t>(i / 3)][static_cast<std::size_t>(i % 3)] = Vector3d(v[0], v[1], v[2]);
  }
  triangles_ = unordered;
  std::vector<int> order(static_cast<std::size_t>(count));
  std::iota(order.begin(), order.end(), 0);
  nodes_.emplace_back();
  build(0, 0, count, order);
  for (int i = 0; i < count; ++i)
    triangles_[static_cast<std::size_t>(i)] = unordered[static_cast<std::size_t>(order[static_cast<std::size_t>(i)])];
}

void SurfaceDistance::build(int node, int first, int count, std::vector<int>& order) {
  Box box{triangles_[static_cast<std::size_t>(order[static_cast<std::size_t>(first)])][0], Vector3d::Zero()};
  box.high = box.low;
  for (int i = first; i < first + count; ++i)
    for (const Vector3d& corner : triangles_[static_cast<std::size_t>(order[static_cast<std::size_t>(i)])]) {
      box.low = box.low.cwiseMin(corner);
      box.high = box.high.cwiseMax(corner);
    }
  Node made{box, first, count};
  if (count > kLeafTriangles) {
    int axis = 0;
    (box.high - box.low).maxCoeff(&axis);
    const auto middle_of = [&](int i) {
      const auto& t = triangles_[static_cast<std::size_t>(i)];
      return t[0][axis] + t[1][axis] + t[2][axis];
    };
    const auto begin = order.begin() + first;
    std::nth_element(begin, begin + count / 2, begin + count,
                     [&](int i, int j) { return middle_of(i) < middle_of(j); });
    made.first = static_cast<int>(nodes_.size());
    made.count = 0;
    nodes_.emplace_back();
    nodes_.emplace_back();
    build(made.first, first, count / 2, order);
    build(made.first + 1, first + count / 2, count - count / 2, order);
  }
  nodes_[static_cast<std::size_t>(node)] = made;
}

double SurfaceDistance::operator()(const Vector3d& point) const {
  double best = std::numeric_limits<double>::infinity();
  std::array<std::pair<double, int>, kMaxDepth> stack;
  int depth = 0;
  stack[0] = {nodes_[0].box.squared_distance(point), 0};
  while (depth >= 0) {
    const auto [distance, index] = stack[static_cast<std::size_t>(depth--)];
    if (distance >= best) continue;
    const Node& node = nodes_[static_cast<std::size_t>(index)];
    for (int i = node.first; i < node.first + node.count; ++i)
      best = std::min(best, squared_distance_to_triangle(point, triangles_[static_cast<std::size_t>(i)]));
    if (node.count > 0) continue;
    std::pair<double, int> children[2];
    for (int k = 0; k < 2; ++k)
      children[k] = {nodes_[static_cast<std::size_t>(node.first + k)].box.squared_distance(point), node.first + k};
    if (children[0].first < children[1].first) std::swap(children[0], children[1]);
    for (const auto& child : children) stack[static_cast<std::size_t>(++depth)] = child;  // the nearer one on top
  }
  return std::sqrt(best);
}

torch::Tensor SurfaceDistance::distances(const torch::Tensor& points_in) const {
  if (points_in.dim() != 2 || points_in.size(1) != 3 || points_in.scalar_type() != torch::kFloat32)
    fail<UsageError>("surface distance: points must be float32 [M,3], found {} {}",
                     torch::toString(points_in.scalar_type()), fmt::join(points_in.sizes(), "x"));
  const torch::Tensor points = points_in.contiguous();
  torch::Tensor result = torch::empty({points.size(0)}, torch::kFloat64);
  const float* from = points.data_ptr<float>();
  double* to = result.data_ptr<double>();
  at::parallel_for(0, points.size(0), 256, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t i = begin; i < end; ++i) to[i] = (*this)(Vector3d(from[3 * i], from[3 * i + 1], from[3 * i + 2]));
  });
  return result;
}

SurfaceGap surface_gap(const torch::Tensor& a, const torch::Tensor& a_faces, const torch::Tensor& b,
                       const torch::Tensor& b_faces) {
  const torch::Tensor to_b = SurfaceDistance(b, b_faces).distances(a);
  const torch::Tensor to_a = SurfaceDistance(a, a_faces).distances(b);
  SurfaceGap gap;
  gap.hausdorff = std::max(to_a.max().item<double>(), to_b.max().item<double>());
  gap.mean = 0.5 * (to_a.mean().item<double>() + to_b.mean().item<double>());
  return gap;
}

}  // namespace doppel
