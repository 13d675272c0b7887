#include "doppel/character/coarse_mesh.h"

#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <queue>
#include <set>

#include "doppel/core/error.h"

namespace doppel {

namespace {

/// One index for all vertices at the same position, and one vertex for each index.
struct WeldedVertices {
  std::vector<int> index;  ///< [N]
  std::vector<int> vertex;
};

WeldedVertices weld_positions(const TriangleMesh& mesh) {
  WeldedVertices welded;
  std::map<std::array<double, 3>, int> known;
  for (int v = 0; v < mesh.num_vertices(); ++v) {
    const Eigen::Vector3d& x = mesh.vertices[v];
    const auto [entry, added] = known.try_emplace({x.x(), x.y(), x.z()}, static_cast<int>(welded.vertex.size()));
    if (added) welded.vertex.push_back(v);
    welded.index.push_back(entry->second);
  }
  return welded;
}

/// Positions, each as far as possible from those before it.
std::vector<int> spread_points(const std::vector<Eigen::Vector3d>& points, int count) {
  std::vector<double> distance(points.size(), std::numeric_limits<double>::infinity());
  std::vector<int> chosen{0};
  while (static_cast<int>(chosen.size()) < count) {
    const Eigen::Vector3d& last = points[chosen.back()];
    std::size_t farthest = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      distance[i] = std::min(distance[i], (points[i] - last).squaredNorm());
      if (distance[i] > distance[farthest]) farthest = i;
    }
    if (distance[farthest] == 0.0) break;
    chosen.push_back(static_cast<int>(farthest));
  }
  return chosen;
}

/// The chosen point that is nearest along edges to each point; nearest in space where no edges lead there.
std::vector<int> nearest_chosen(const std::vector<Eigen::Vector3d>& points, const std::vector<std::vector<int>>& ring,
                                const std::vector<int>& chosen) {
  std::vector<int> nearest(points.size(), -1);
  std::vector<double> distance(points.size(), std::numeric_limits<double>::infinity());
  using Entry = std::pair<double, int>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
  for (std::size_t k = 0; k < chosen.size(); ++k) {
    nearest[chosen[k]] = static_cast<int>(k);
    distance[chosen[k]] = 0.0;
    queue.emplace(0.0, chosen[k]);
  }
  while (!queue.empty()) {
    const auto [far, at] = queue.top();
    queue.pop();
    if (far > distance[at]) continue;
    for (const int next : ring[at]) {
      const double there = far + (points[next] - points[at]).norm();
      if (there >= distance[next]) continue;
      distance[next] = there;
      nearest[next] = nearest[at];
      queue.emplace(there, next);
    }
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (nearest[i] >= 0) continue;
    const auto nearer = [&](int a, int b) {
      return (points[a] - points[i]).squaredNorm() < (points[b] - points[i]).squaredNorm();
    };
    nearest[i] = static_cast<int>(std::min_element(chosen.begin(), chosen.end(), nearer) - chosen.begin());
  }
  return nearest;
}

/// Joins each vertex that is in no face to the two vertices nearest to it.
void join_loose(TriangleMesh& coarse) {
  std::vector<bool> used(coarse.vertices.size(), false);
  for (const Triangle& face : coarse.faces)
    for (const int vertex : face) used[vertex] = true;
  for (std::size_t k = 0; k < coarse.vertices.size(); ++k) {
    if (used[k]) continue;
    std::vector<std::pair<double, int>> others;
    for (std::size_t other = 0; other < coarse.vertices.size(); ++other)
      if (other != k)
        others.emplace_back((coarse.vertices[other] - coarse.vertices[k]).squaredNorm(), static_cast<int>(other));
    std::partial_sort(others.begin(), others.begin() + 2, others.end());
    coarse.faces.push_back({static_cast<int>(k), others[0].second, others[1].second});
    used[k] = used[others[0].second] = used[others[1].second] = true;
  }
}

}  // namespace

TriangleMesh coarse_mesh(const TriangleMesh& mesh, int nodes) {
  const WeldedVertices welded = weld_positions(mesh);
  if (welded.vertex.size() < 3)
    fail("the surface has vertices at {} positions; an embedded graph needs at least 3", welded.vertex.size());
  std::vector<Eigen::Vector3d> points;
  for (const int vertex : welded.vertex) points.push_back(mesh.vertices[vertex]);
  std::vector<std::vector<int>> ring(points.size());
  for (const Triangle& face : mesh.faces)
    for (std::size_t c = 0; c < 3; ++c) {
      const int a = welded.index[face[c]], b = welded.index[face[(c + 1) % 3]];
      if (a == b) continue;
      ring[a].push_back(b);
      ring[b].push_back(a);
    }
  const std::vector<int> chosen = spread_points(points, std::clamp(nodes, 3, static_cast<int>(points.size())));
  const std::vector<int> nearest = nearest_chosen(points, ring, chosen);
  TriangleMesh coarse;
  for (const int point : chosen) coarse.vertices.push_back(points[point]);
  std::set<Triangle> known;
  for (const Triangle& face : mesh.faces) {
    Triangle regions{};
    for (std::size_t c = 0; c < 3; ++c) regions[c] = nearest[welded.index[face[c]]];
    Triangle sorted = regions;
    std::sort(sorted.begin(), sorted.end());
    if (sorted[0] == sorted[1] || sorted[1] == sorted[2] || !known.insert(sorted).second) continue;
    coarse.faces.push_back(regions);
  }
  join_loose(coarse);
  return coarse;
}

}  // namespace doppel
