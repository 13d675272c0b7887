#include "doppel/rigging/scan/hole_filling.h"

#include <Eigen/Geometry>
#include <limits>

#include "doppel/rigging/scan/edge_table.h"

namespace doppel {
namespace {
constexpr double kNever = std::numeric_limits<double>::infinity();
}

std::vector<BorderLoop> border_loops(const TriangleMesh& mesh, const std::vector<int>& across) {
  std::vector<int> leaving(mesh.vertices.size(), -1);
  for (std::size_t h = 0; h < across.size(); ++h)
    if (across[h] < 0) leaving[half_start(mesh.faces, static_cast<int>(h))] = static_cast<int>(h);
  std::vector<bool> seen(across.size(), false);
  std::vector<BorderLoop> loops;
  for (std::size_t start = 0; start < across.size(); ++start) {
    if (across[start] >= 0 || seen[start]) continue;
    BorderLoop loop;
    for (int h = static_cast<int>(start); h >= 0 && !seen[h];) {
      seen[h] = true;
      loop.halves.push_back(h);
      const int end = half_end(mesh.faces, h);
      loop.length += (mesh.vertices[end] - mesh.vertices[half_start(mesh.faces, h)]).norm();
      h = leaving[end];
    }
    loops.push_back(std::move(loop));
  }
  return loops;
}

// The least area over the corners i..j of the line, for all i < j (Barequet & Sharir 1995).
std::vector<Triangle> least_area_triangles(const std::vector<Eigen::Vector3d>& line,
                                           const std::vector<std::vector<bool>>& has_edge, double& area) {
  const std::size_t n = line.size();
  std::vector<std::vector<double>> least(n, std::vector<double>(n, 0.0));
  std::vector<std::vector<int>> apex(n, std::vector<int>(n, -1));
  for (std::size_t span = 2; span < n; ++span)
    for (std::size_t i = 0; i + span < n; ++i) {
      const std::size_t j = i + span;
      least[i][j] = kNever;
      if (span + 1 < n && has_edge[i][j]) continue;  // i to j is no border edge itself
      for (std::size_t m = i + 1; m < j; ++m) {
        const double before = least[i][m] + least[m][j];
        if (!(before < least[i][j])) continue;
        const double total = before + 0.5 * (line[m] - line[i]).cross(line[j] - line[i]).norm();
        if (total >= least[i][j]) continue;
        least[i][j] = total;
        apex[i][j] = static_cast<int>(m);
      }
    }
  area = n < 3 ? kNever : least[0][n - 1];
  std::vector<Triangle> triangles;
  if (!(area < kNever)) return triangles;
  std::vector<std::array<int, 2>> open{{0, static_cast<int>(n) - 1}};
  while (!open.empty()) {
    const auto [i, j] = open.back();
    open.pop_back();
    if (j - i < 2) continue;
    const int m = apex[i][j];
    triangles.push_back({i, j, m});  // against the border's sense
    open.push_back({i, m});
    open.push_back({m, j});
  }
  return triangles;
}

}  // namespace doppel
