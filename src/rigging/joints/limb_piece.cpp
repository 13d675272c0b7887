#include "doppel/rigging/joints/limb_piece.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>
#include <map>

#include "doppel/geometry/topology.h"

namespace doppel {
namespace {

using Eigen::Vector3d;
using Edge = std::array<int, 2>;

constexpr double kMaxHole = 0.5;  // share of the length of a piece

/// The directed edges of a surface without a partner in the opposite direction, each as often as it lacks partners.
std::vector<Edge> open_edges(const std::vector<Triangle>& faces) {
  std::map<Edge, int> surplus;
  for (const Triangle& face : faces)
    for (std::size_t k = 0; k < 3; ++k) {
      const int a = face[k], b = face[(k + 1) % 3];
      if (a != b) surplus[{std::min(a, b), std::max(a, b)}] += a < b ? 1 : -1;
    }
  std::vector<Edge> edges;
  for (const auto& [edge, count] : surplus)
    for (int i = 0; i < std::abs(count); ++i) edges.push_back(count > 0 ? edge : Edge{edge[1], edge[0]});
  return edges;
}

void sort_unique(std::vector<int>& items) {
  std::sort(items.begin(), items.end());
  items.erase(std::unique(items.begin(), items.end()), items.end());
}

double tetrahedron(const Vector3d& a, const Vector3d& b, const Vector3d& c) { return a.dot(b.cross(c)) / 6.0; }

}  // namespace

LimbPiece::LimbPiece(const std::vector<Vector3d>& vertices, const std::vector<Triangle>& faces,
                     const std::vector<bool>& of_limb, const LimbPositions& positions) {
  const Vector3d upper = positions.joint - positions.top, lower = positions.end - positions.joint;
  const Vector3d from = positions.top + 0.5 * upper, to = positions.joint + 0.5 * lower;
  const auto inside = [&](int v) {
    const Vector3d& p = vertices[v];
    return of_limb[v] && (p - from).dot(upper) >= 0.0 && (p - to).dot(lower) <= 0.0;
  };
  for (const Triangle& face : faces)
    if (std::all_of(face.begin(), face.end(), inside)) faces_.push_back(face);
  const std::vector<Edge> open = open_edges(faces_);
  const std::vector<int> hole = MeshTopology(static_cast<int>(vertices.size()), open).components();
  std::map<int, Cap> caps;
  for (const Edge& edge : open) {
    Cap& cap = caps[hole[edge[0]]];
    cap.edges.push_back({edge[1], edge[0]});
    cap.vertices.insert(cap.vertices.end(), edge.begin(), edge.end());
  }
  for (auto& [component, cap] : caps) {
    sort_unique(cap.vertices);
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (const int v : cap.vertices) {
      const double along = (vertices[v] - from).dot(to - from) / (to - from).squaredNorm();
      low = std::min(low, along);
      high = std::max(high, along);
    }
    if (high - low > kMaxHole) {
      faces_.clear();
      caps_.clear();
      return;
    }
    caps_.push_back(std::move(cap));
  }
  for (const Triangle& face : faces_) vertices_.insert(vertices_.end(), face.begin(), face.end());
  sort_unique(vertices_);
}

double LimbPiece::volume(const std::vector<Vector3d>& vertices) const {
  const auto at = [&](int v) -> const Vector3d& { return vertices[v]; };
  double sum = 0.0;
  for (const Triangle& face : faces_) sum += tetrahedron(at(face[0]), at(face[1]), at(face[2]));
  for (const Cap& cap : caps_) {
    Vector3d middle = Vector3d::Zero();
    for (const int v : cap.vertices) middle += at(v) / static_cast<double>(cap.vertices.size());
    for (const Edge& edge : cap.edges) sum += tetrahedron(at(edge[0]), at(edge[1]), middle);
  }
  return sum;
}

}  // namespace doppel
