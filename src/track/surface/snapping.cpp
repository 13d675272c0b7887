#include "doppel/track/surface/snapping.h"

#include <cmath>
#include <optional>

#include "doppel/core/as_size.h"

namespace doppel {
namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kSteps = 20;                       // largest number of Newton steps on the distance
constexpr double kArrived = thesis_pixels(0.1);  // reference pixels
constexpr double kMinSquaredGradient = 0.05;     // squared; on a ridge of the distance field the gradient vanishes

/// The pixel at the vertex's target distance, along the gradient of the distance field; nothing if it is not reached.
std::optional<Vector2d> walk(const OutlineTerm::Evidence& evidence, const OutlineVertex& vertex, const Vector2d& start,
                             double farthest) {
  const double reference = reference_pixels(evidence.camera);
  const double enough = kArrived / reference;
  const char part = evidence.vertex_part[vertex.vertex];
  Vector2d pixel = start;
  for (int step = 0; step < kSteps; ++step) {
    const OutlineField::Sample sample = evidence.field.at(pixel);
    const double ahead = sample.distance - vertex.distance / reference;
    if (std::abs(ahead) < enough) return pixel;
    if (!(sample.gradient.squaredNorm() > kMinSquaredGradient)) return std::nullopt;
    pixel -= ahead / sample.gradient.squaredNorm() * sample.gradient;
    if (!((pixel - start).norm() <= farthest) || !evidence.parts.allows(part, pixel)) return std::nullopt;
  }
  return std::nullopt;
}

/// The point of the same depth that projects to another pixel.
Vector3d at_own_depth(const PinholeCamera& camera, const Vector3d& point, const Vector2d& pixel) {
  const double depth = camera.camera_from_world(point).z();
  const Vector3d ray = camera.K.inverse() * Vector3d(pixel.x(), pixel.y(), 1.0);
  return camera.R.transpose() * (depth * ray - camera.t);
}

/// Unmarked vertices that may move and lie within some rings of marked ones, ascending.
std::vector<int> followers(const MeshTopology& topology, std::vector<char> marked, const std::vector<double>& rigidity,
                           const SnapOptions& options) {
  const std::vector<char> leaders = marked;
  for (int ring = 0; ring < options.rings; ++ring) {
    const std::vector<char> inner = marked;
    for (int v = 0; v < topology.num_vertices(); ++v)
      if (inner[v])
        for (const int n : topology.one_ring().row(v)) marked[n] = 1;
  }
  std::vector<int> result;
  for (std::size_t v = 0; v < marked.size(); ++v)
    if (marked[v] && !leaders[v] && rigidity[v] <= options.max_rigidity) result.push_back(static_cast<int>(v));
  return result;
}

/// Moves each follower such that its offset from the mean of its neighbours stays the same.
void warp(Matrix3Xd& vertices, const Matrix3Xd& before, const std::vector<int>& moving, const MeshTopology& topology,
          int sweeps) {
  for (int sweep = 0; sweep < sweeps; ++sweep)
    for (const int v : moving) {
      Vector3d sum = Vector3d::Zero();
      for (const int n : topology.one_ring().row(v)) sum += vertices.col(n) - before.col(n);
      vertices.col(v) = before.col(v) + sum / topology.one_ring().size(v);
    }
}

}  // namespace

int snap_outline(Matrix3Xd& vertices, const OutlineTerm::Evidence& evidence, const std::vector<OutlineVertex>& outline,
                 const MeshTopology& topology, const std::vector<double>& rigidity,
                 const std::vector<char>& was_outline, const SnapOptions& options) {
  const Matrix3Xd before = vertices;
  const double farthest = options.farthest / reference_pixels(evidence.camera);
  std::vector<char> snapped(rigidity.size(), 0);
  int count = 0;
  for (const OutlineVertex& vertex : outline) {
    const auto v = as_size(vertex.vertex);
    if (rigidity[v] > options.max_rigidity) continue;
    const auto projected = project_with_jacobian(evidence.camera, before.col(vertex.vertex));
    if (!projected || belongs_to_opposite_outline(*projected, evidence.normals[v], evidence.field.at(projected->pixel)))
      continue;
    const auto pixel = walk(evidence, vertex, projected->pixel, farthest);
    if (!pixel) continue;
    const Vector3d there = at_own_depth(evidence.camera, before.col(vertex.vertex), *pixel);
    const double share = was_outline.empty() || was_outline[v] ? 1.0 : options.first_share;
    vertices.col(vertex.vertex) += share * (there - before.col(vertex.vertex));
    snapped[v] = 1;
    ++count;
  }
  warp(vertices, before, followers(topology, snapped, rigidity, options), topology, options.sweeps);
  return count;
}

int clamp_isolated_motion(Matrix3Xd& vertices, const Matrix3Xd& before, const MeshTopology& topology, double factor) {
  const Eigen::VectorXd moved = (vertices - before).colwise().norm();
  int count = 0;
  for (int v = 0; v < topology.num_vertices(); ++v) {
    if (topology.one_ring().size(v) == 0) continue;
    double around = 0.0;
    for (const int n : topology.one_ring().row(v)) around += moved[n];
    around /= topology.one_ring().size(v);
    if (moved[v] <= factor * around) continue;
    vertices.col(v) = before.col(v) + around / moved[v] * (vertices.col(v) - before.col(v));
    ++count;
  }
  return count;
}

}  // namespace doppel
