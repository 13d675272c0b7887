#include "doppel/eval/surface_shape.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"
#include "doppel/geometry/topology.h"

namespace doppel {

using torch::Tensor;

namespace {

/// Roughness that float32 positions have by rounding alone is ten times smaller, metres.
constexpr double kMinRoughness = 1e-6;

std::vector<Triangle> triangles_of(const Tensor& faces) {
  const Tensor rows = faces.contiguous();
  const int* f = rows.data_ptr<int>();
  std::vector<Triangle> triangles;
  for (std::int64_t i = 0; i < rows.size(0); ++i, f += 3) triangles.push_back({f[0], f[1], f[2]});
  return triangles;
}

/// How many faces have each edge {a,b}, a < b.
std::map<std::array<int, 2>, int> faces_of_edges(const std::vector<Triangle>& faces) {
  std::map<std::array<int, 2>, int> count;
  for (const Triangle& face : faces)
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [a, b] = std::minmax(face[k], face[(k + 1) % 3]);
      if (a != b) ++count[{a, b}];
    }
  return count;
}

Tensor pairs_tensor(const std::vector<std::array<int, 2>>& pairs) {
  Tensor tensor = torch::empty({static_cast<std::int64_t>(pairs.size()), 2}, torch::kInt64);
  std::int64_t* out = tensor.data_ptr<std::int64_t>();
  for (const auto& pair : pairs) out = std::copy(pair.begin(), pair.end(), out);
  return tensor;
}

/// The edge of a face whose ends have the same label, if its third vertex has another one.
std::optional<std::array<int, 2>> edge_along_border(const Triangle& face, const std::vector<int>& labels) {
  for (std::size_t k = 0; k < 3; ++k) {
    const int a = face[k], b = face[(k + 1) % 3], c = face[(k + 2) % 3];
    if (labels[as_size(a)] == labels[as_size(b)] && labels[as_size(a)] != labels[as_size(c)])
      return std::array<int, 2>{a, b};
  }
  return std::nullopt;
}

}  // namespace

SurfaceShape::SurfaceShape(const Tensor& faces, std::int64_t num_vertices, const std::vector<int>& labels)
    : num_vertices_(num_vertices) {
  check_tensor("surface shape", "faces", faces, {torch::kInt32}, {-1, 3}, "[F,3]");
  if (!labels.empty() && labels.size() != as_size(num_vertices))
    fail<UsageError>("surface shape: {} labels for {} vertices; give one for each vertex, or none", labels.size(),
                     num_vertices);
  faces_ = faces.to(torch::kInt64);
  const std::vector<Triangle> triangles = triangles_of(faces);
  std::vector<std::array<int, 2>> edges;
  for (const auto& [edge, count] : faces_of_edges(triangles)) edges.push_back(edge);
  const Tensor pairs = pairs_tensor(MeshTopology(static_cast<int>(num_vertices), edges).edges());
  source_ = torch::cat({pairs.select(1, 0), pairs.select(1, 1)});
  target_ = torch::cat({pairs.select(1, 1), pairs.select(1, 0)});
  degree_ = torch::zeros({num_vertices, 1}, torch::kFloat64);
  degree_.index_add_(0, source_, torch::ones({source_.size(0), 1}, torch::kFloat64));
  find_borders(triangles, labels);
}

void SurfaceShape::find_borders(const std::vector<Triangle>& faces, const std::vector<int>& labels) {
  std::vector<std::array<int, 2>> edges;
  std::vector<double> shares;
  for (const auto& [edge, count] : faces_of_edges(faces))
    if (count == 1) edges.push_back(edge);
  shares.assign(edges.size(), 1.0);
  if (!labels.empty())
    for (const Triangle& face : faces)
      if (const auto edge = edge_along_border(face, labels)) edges.push_back(*edge);
  shares.resize(edges.size(), 0.5);
  border_ = pairs_tensor(edges);
  border_share_ = torch::tensor(shares, torch::kFloat64);
}

Tensor SurfaceShape::area_normals(const Tensor& vertices) const {
  check_shape("surface shape", "vertices", vertices, {num_vertices_, 3}, "[N,3]");
  const Tensor x = vertices.to(torch::kFloat64);
  const auto corner = [&](int k) { return x.index_select(0, faces_.select(1, k)); };
  const Tensor face_normal = at::cross(corner(1) - corner(0), corner(2) - corner(0), 1);
  Tensor normal = torch::zeros_like(x);
  for (int k = 0; k < 3; ++k) normal.index_add_(0, faces_.select(1, k), face_normal);
  return normal;
}

Tensor SurfaceShape::laplacian(const Tensor& values) const {
  check_shape("surface shape", "values", values, {num_vertices_, 3}, "[N,3]");
  const Tensor x = values.to(torch::kFloat64);
  const Tensor differences = x.index_select(0, source_) - x.index_select(0, target_);
  return torch::zeros_like(x).index_add_(0, source_, differences) / degree_.clamp_min(1.0);
}

double SurfaceShape::border_length(const Tensor& vertices) const {
  check_shape("surface shape", "vertices", vertices, {num_vertices_, 3}, "[N,3]");
  const Tensor x = vertices.to(torch::kFloat64);
  const Tensor along = x.index_select(0, border_.select(1, 0)) - x.index_select(0, border_.select(1, 1));
  return (border_share_ * along.norm(2, 1)).sum().item<double>();
}

void ShapeErrors::add(const Tensor& vertices, const Tensor& expected) {
  const Tensor a = shape_.area_normals(vertices), b = shape_.area_normals(expected);
  const Tensor known = (a.norm(2, 1) > 0) & (b.norm(2, 1) > 0);
  const Tensor angle = torch::atan2(at::cross(a, b, 1).norm(2, 1), (a * b).sum(1)).masked_select(known);
  if (angle.numel() > 0) normal_.add(angle.mean().item<double>() * 180.0 / M_PI);
  difference_.add(square(vertices.to(torch::kFloat64) - expected));
  if (const double length = shape_.border_length(expected); length > 0.0)
    border_.add(shape_.border_length(vertices) / length);
}

void ShapeErrors::add_displacements(const Tensor& found, const Tensor& expected) {
  found_.add(square(found));
  expected_.add(square(expected));
}

std::optional<double> ShapeErrors::roughness_error() const {
  const auto mean = value_of(difference_);
  return mean ? std::make_optional(std::sqrt(*mean)) : std::nullopt;
}

std::optional<double> ShapeErrors::roughness_ratio() const {
  const auto expected = value_of(expected_);
  if (!expected || std::sqrt(*expected) < kMinRoughness) return std::nullopt;
  return std::sqrt(found_.value() / *expected);
}

std::optional<double> ShapeErrors::value_of(const Mean& mean) {
  return mean.count > 0 ? std::make_optional(mean.value()) : std::nullopt;
}

double ShapeErrors::square(const Tensor& values) const {
  return shape_.laplacian(values).square().sum(1).mean().item<double>();
}

}  // namespace doppel
