#include "doppel/geometry/unwrap.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <deque>
#include <limits>
#include <numeric>
#include <unordered_map>

#include "doppel/core/error.h"

namespace doppel {

namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

/// Direction d = 0..5: +x -x +y -y +z -z. The projection keeps the orientation of a face that faces direction d.
Vector2d flatten(const Vector3d& p, int direction) {
  const int axis = direction / 2, u = (axis + 1) % 3, v = (axis + 2) % 3;
  const double sign = direction % 2 == 0 ? 1 : -1;
  return {sign * p[u], p[v]};
}

double along(const Vector3d& normal, int direction) { return (direction % 2 == 0 ? 1 : -1) * normal[direction / 2]; }

struct FaceGraph {
  std::vector<std::array<int, 3>> neighbour;  ///< [F] the face across edge c -> c+1
  std::vector<Vector3d> normal;               ///< [F] unit

  explicit FaceGraph(const TriangleMesh& mesh) : neighbour(mesh.faces.size(), {-1, -1, -1}) {
    std::unordered_map<std::uint64_t, std::pair<int, int>> half_edge;
    const auto key = [](int a, int b) { return static_cast<std::uint64_t>(a) << 32 | static_cast<std::uint32_t>(b); };
    for (int f = 0; f < mesh.num_faces(); ++f) {
      const Triangle& t = mesh.faces[f];
      normal.push_back(
          (mesh.vertices[t[1]] - mesh.vertices[t[0]]).cross(mesh.vertices[t[2]] - mesh.vertices[t[0]]).normalized());
      for (int c = 0; c < 3; ++c) half_edge[key(t[c], t[(c + 1) % 3])] = {f, c};
    }
    for (int f = 0; f < mesh.num_faces(); ++f)
      for (int c = 0; c < 3; ++c) {
        const auto found = half_edge.find(key(mesh.faces[f][(c + 1) % 3], mesh.faces[f][c]));
        if (found != half_edge.end()) neighbour[f][c] = found->second.first;
      }
  }
};

/// The direction of each face, smoothed so that single faces take the direction of their neighbours if their normals
/// allow it.
std::vector<int> choose_directions(const FaceGraph& graph) {
  const int faces = static_cast<int>(graph.normal.size());
  std::vector<int> direction(faces);
  for (int f = 0; f < faces; ++f)
    for (int d = 1; d < 6; ++d)
      if (along(graph.normal[f], d) > along(graph.normal[f], direction[f])) direction[f] = d;
  for (int round = 0; round < 12; ++round) {
    const std::vector<int> old = direction;
    for (int f = 0; f < faces; ++f) {
      double best = -1;
      for (int d = 0; d < 6; ++d) {
        const double slope = along(graph.normal[f], d);
        if (slope < 0.35) continue;
        double score = 0.9 * slope;
        for (const int n : graph.neighbour[f]) score += n >= 0 && old[n] == d ? 0.6 : 0;
        if (score > best) best = score, direction[f] = d;
      }
    }
  }
  return direction;
}

bool separated(const Vector2d* a, const Vector2d* b) {
  for (int c = 0; c < 3; ++c) {
    const Vector2d edge = a[(c + 1) % 3] - a[c];
    const Vector2d out(edge.y(), -edge.x());
    // Triangles are counter-clockwise. If all of b is on the outer side of one edge of a, they do not overlap.
    double nearest = std::numeric_limits<double>::infinity();
    for (int k = 0; k < 3; ++k) nearest = std::min(nearest, out.dot(b[k] - a[c]) / edge.norm());
    if (nearest > -1e-9) return true;
  }
  return false;
}

/// The triangles of one chart, with search by position.
class Occupancy {
 public:
  explicit Occupancy(double cell) : cell_(cell) {}

  bool free(const Vector2d* triangle) const {
    bool result = true;
    visit(triangle, [&](std::uint64_t key) {
      const auto found = cells_.find(key);
      if (!result || found == cells_.end()) return;
      for (const int other : found->second)
        if (!separated(triangle, &points_[3 * other]) && !separated(&points_[3 * other], triangle)) result = false;
    });
    return result;
  }

  void add(const Vector2d* triangle) {
    const int index = static_cast<int>(points_.size() / 3);
    points_.insert(points_.end(), triangle, triangle + 3);
    visit(triangle, [&](std::uint64_t key) { cells_[key].push_back(index); });
  }

 private:
  template <typename Visit>
  void visit(const Vector2d* t, const Visit& visit_cell) const {
    const Vector2d low = t[0].cwiseMin(t[1]).cwiseMin(t[2]) / cell_, high = t[0].cwiseMax(t[1]).cwiseMax(t[2]) / cell_;
    for (int y = static_cast<int>(std::floor(low.y())); y <= static_cast<int>(std::floor(high.y())); ++y)
      for (int x = static_cast<int>(std::floor(low.x())); x <= static_cast<int>(std::floor(high.x())); ++x)
        visit_cell(static_cast<std::uint64_t>(static_cast<std::uint32_t>(x)) << 32 | static_cast<std::uint32_t>(y));
  }

  double cell_;
  std::vector<Vector2d> points_;
  std::unordered_map<std::uint64_t, std::vector<int>> cells_;
};

struct Chart {
  std::vector<int> faces;
  int direction;
  Vector2d low, size, position;
};

std::array<Vector2d, 3> flat_face(const TriangleMesh& mesh, int face, int direction) {
  std::array<Vector2d, 3> t;
  for (int c = 0; c < 3; ++c) t[c] = flatten(mesh.vertices[mesh.faces[face][c]], direction);
  return t;
}

std::vector<Chart> grow_charts(const TriangleMesh& mesh) {
  const FaceGraph graph(mesh);
  const std::vector<int> direction = choose_directions(graph);
  std::vector<bool> taken(mesh.num_faces(), false);
  std::vector<Chart> charts;
  for (int seed = 0; seed < mesh.num_faces(); ++seed) {
    if (taken[seed]) continue;
    Chart chart{{}, direction[seed], Vector2d::Constant(1e9), Vector2d::Zero(), Vector2d::Zero()};
    Vector2d high = Vector2d::Constant(-1e9);
    Occupancy occupancy(0.03);
    std::deque<int> front{seed};
    while (!front.empty()) {
      const int f = front.front();
      front.pop_front();
      if (taken[f]) continue;
      const auto t = flat_face(mesh, f, chart.direction);
      if (!occupancy.free(t.data())) continue;
      occupancy.add(t.data());
      taken[f] = true;
      chart.faces.push_back(f);
      for (const Vector2d& p : t) chart.low = chart.low.cwiseMin(p), high = high.cwiseMax(p);
      for (const int n : graph.neighbour[f])
        if (n >= 0 && !taken[n] && direction[n] == chart.direction) front.push_back(n);
    }
    chart.size = high - chart.low;
    charts.push_back(std::move(chart));
  }
  return charts;
}

/// Packs charts of `scale` times their size in rows. False when the unit square is too small.
bool pack(std::vector<Chart>& charts, double scale, double gutter) {
  double x = 0, y = 0, shelf = 0;
  for (Chart& chart : charts) {
    const Vector2d size = scale * chart.size + Vector2d::Constant(2 * gutter);
    if (x + size.x() > 1) y += shelf, x = 0, shelf = 0;
    if (x + size.x() > 1 || y + size.y() > 1) return false;
    chart.position = {x + gutter, y + gutter};
    x += size.x();
    shelf = std::max(shelf, size.y());
  }
  return true;
}

}  // namespace

void unwrap(TriangleMesh& mesh, double gutter) {
  std::vector<Chart> charts = grow_charts(mesh);
  std::stable_sort(charts.begin(), charts.end(),
                   [](const Chart& a, const Chart& b) { return a.size.y() > b.size.y(); });
  double scale = 1;
  while (scale > 1e-3 && !pack(charts, scale, gutter)) scale *= 0.98;
  if (!pack(charts, scale, gutter)) fail("unwrapping: {} charts with a gutter of {} do not fit", charts.size(), gutter);
  mesh.uvs.clear();
  mesh.face_uvs.assign(mesh.faces.size(), {0, 0, 0});
  for (const Chart& chart : charts) {
    std::unordered_map<int, int> corner;
    for (const int f : chart.faces)
      for (int c = 0; c < 3; ++c) {
        const int v = mesh.faces[f][c];
        const auto [entry, added] = corner.emplace(v, static_cast<int>(mesh.uvs.size()));
        if (added)
          mesh.uvs.emplace_back(chart.position + scale * (flatten(mesh.vertices[v], chart.direction) - chart.low));
        mesh.face_uvs[f][c] = entry->second;
      }
  }
}

}  // namespace doppel
