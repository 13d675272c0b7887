#include "doppel/rigging/scan/voxel_parts.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace doppel {
namespace {

using Eigen::Vector3d;

/// Whether a triangle touches a cube (separating axes, Akenine-Moeller 2001). @param p corners relative to the centre
bool touches_cube(const std::array<Vector3d, 3>& p, double half) {
  const auto apart = [&](const Vector3d& axis) {
    const double a = axis.dot(p[0]), b = axis.dot(p[1]), c = axis.dot(p[2]);
    const double reach = half * axis.cwiseAbs().sum();
    return std::min({a, b, c}) > reach || std::max({a, b, c}) < -reach;
  };
  for (int k = 0; k < 3; ++k)
    if (apart(Vector3d::Unit(k))) return false;
  const std::array<Vector3d, 3> edges{p[1] - p[0], p[2] - p[1], p[0] - p[2]};
  if (apart(edges[0].cross(edges[1]))) return false;
  for (const Vector3d& edge : edges)
    for (int k = 0; k < 3; ++k)
      if (apart(edge.cross(Vector3d::Unit(k)))) return false;
  return true;
}

/// Calls action(index) for the six neighbours of a cell.
template <typename Action>
void for_neighbours(const VoxelLayout& layout, int cell, const Action& action) {
  const auto& n = layout.dims;
  const int x = cell % n[0], y = cell / n[0] % n[1], z = cell / (n[0] * n[1]);
  if (x > 0) action(cell - 1);
  if (x + 1 < n[0]) action(cell + 1);
  if (y > 0) action(cell - n[0]);
  if (y + 1 < n[1]) action(cell + n[0]);
  if (z > 0) action(cell - n[0] * n[1]);
  if (z + 1 < n[2]) action(cell + n[0] * n[1]);
}

/// All cells that `start` reaches over cells not marked; marks them.
std::vector<int> flooded(const VoxelLayout& layout, std::vector<int> start, std::vector<std::uint8_t>& marked) {
  std::vector<int> cells = std::move(start);
  for (std::size_t i = 0; i < cells.size(); ++i)
    for_neighbours(layout, cells[i], [&](int next) {
      if (marked[next] != 0) return;
      marked[next] = 1;
      cells.push_back(next);
    });
  return cells;
}

}  // namespace

std::vector<std::uint8_t> crossed_cells(const VoxelLayout& layout, const Vector3d& origin, double cell,
                                        const TriangleMesh& mesh) {
  std::vector<std::uint8_t> crossed(layout.size(), 0);
  for (const Triangle& face : mesh.faces) {
    std::array<Vector3d, 3> corners;
    for (int k = 0; k < 3; ++k) corners[k] = (mesh.vertices[face[k]] - origin) / cell;
    std::array<int, 3> low, high;
    for (int k = 0; k < 3; ++k) {
      const auto [least, most] = std::minmax({corners[0][k], corners[1][k], corners[2][k]});
      low[k] = std::clamp(static_cast<int>(std::floor(least)), 0, layout.dims[k] - 1);
      high[k] = std::clamp(static_cast<int>(std::floor(most)), 0, layout.dims[k] - 1);
    }
    for (int z = low[2]; z <= high[2]; ++z)
      for (int y = low[1]; y <= high[1]; ++y)
        for (int x = low[0]; x <= high[0]; ++x) {
          std::uint8_t& mark = crossed[layout.index(x, y, z)];
          if (mark != 0) continue;
          const Vector3d middle(x + 0.5, y + 0.5, z + 0.5);
          mark = touches_cube({corners[0] - middle, corners[1] - middle, corners[2] - middle}, 0.5);
        }
  }
  return crossed;
}

std::vector<std::uint8_t> dilated(const VoxelLayout& layout, const std::vector<std::uint8_t>& cells, int radius) {
  std::vector<std::uint8_t> out = cells;
  const std::array<int, 3> stride{1, layout.dims[0], layout.dims[0] * layout.dims[1]};
  for (int axis = 0; axis < 3; ++axis) {
    const std::vector<std::uint8_t> before = out;
    const int length = layout.dims[axis], step = stride[axis];
    for (int i = 0; i < static_cast<int>(layout.size()); ++i) {
      if (before[i] == 0) continue;
      const int position = i / step % length;
      for (int k = std::max(-radius, -position); k <= std::min(radius, length - 1 - position); ++k)
        out[i + k * step] = 1;
    }
  }
  return out;
}

std::vector<std::vector<int>> enclosed_spaces(const VoxelLayout& layout, const std::vector<std::uint8_t>& wall) {
  std::vector<std::uint8_t> marked = wall;
  std::vector<int> border;
  const auto& n = layout.dims;
  for (int z = 0; z < n[2]; ++z)
    for (int y = 0; y < n[1]; ++y)
      for (int x = 0; x < n[0]; ++x) {
        if (x > 0 && y > 0 && z > 0 && x + 1 < n[0] && y + 1 < n[1] && z + 1 < n[2]) continue;
        std::uint8_t& mark = marked[layout.index(x, y, z)];
        if (mark != 0) continue;
        mark = 1;
        border.push_back(layout.index(x, y, z));
      }
  flooded(layout, std::move(border), marked);
  std::vector<std::vector<int>> spaces;
  for (std::size_t i = 0; i < marked.size(); ++i) {
    if (marked[i] != 0) continue;
    marked[i] = 1;
    spaces.push_back(flooded(layout, {static_cast<int>(i)}, marked));
  }
  return spaces;
}

}  // namespace doppel
