#include "doppel/rigging/weights/heat_domain.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel {
namespace {

constexpr int kAirLayers = 2;
constexpr double kThickness = 0.25;  // of a bone: the share of its distance to the surface that it fills
constexpr double kTie = 1e-6;        // metres; bones at the same distance share a cell

/// The same solid in a grid that holds all points, with a margin.
SolidGrid padded(const SolidGrid& solid, const std::vector<HeatBone>& bones,
                 const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3i low(0, 0, 0), high(solid.size[0] - 1, solid.size[1] - 1, solid.size[2] - 1);
  const auto hold = [&](const Eigen::Vector3d& p) {
    low = low.cwiseMin(solid.cell_of(p));
    high = high.cwiseMax(solid.cell_of(p));
  };
  for (const HeatBone& bone : bones)
    for (const auto& segment : bone.segments)
      for (const Eigen::Vector3d& p : segment) hold(p);
  for (const Eigen::Vector3d& p : points) hold(p);
  low.array() -= kAirLayers + 2;
  high.array() += kAirLayers + 2;
  const Eigen::Vector3i size = high - low + Eigen::Vector3i::Ones();
  if (size.cast<double>().prod() > 1e9)
    fail(
        "skinning weights: the mesh and bones extend over {} x {} x {} cells of {} m, 1e9 cells are allowed; "
        "use larger cells, or remove parts that lie far away",
        size.x(), size.y(), size.z(), solid.cell);
  SolidGrid grid;
  grid.cell = solid.cell;
  grid.origin = solid.origin + solid.cell * low.cast<double>();
  grid.size = {size.x(), size.y(), size.z()};
  grid.inside.assign(as_size(size.x()) * as_size(size.y()) * as_size(size.z()), 0);
  for (int z = 0; z < solid.size[2]; ++z)
    for (int y = 0; y < solid.size[1]; ++y)
      for (int x = 0; x < solid.size[0]; ++x)
        grid.inside[grid.index(x - low.x(), y - low.y(), z - low.z())] = solid.inside[solid.index(x, y, z)];
  return grid;
}

/// Calls visit(cell) for the cells beside a cell, which must not lie at the border of the grid.
template <typename Visit>
void for_neighbours(const SolidGrid& grid, std::size_t cell, const Visit& visit) {
  const std::size_t row = as_size(grid.size[0]), layer = row * as_size(grid.size[1]);
  for (const std::size_t step : {std::size_t{1}, row, layer}) {
    visit(cell - step);
    visit(cell + step);
  }
}

/// Marks the cells of the domain in `wanted`: inside, air around it, and the stencils of the points.
std::vector<std::uint8_t> wanted_cells(const HeatDomain& domain, const std::vector<Eigen::Vector3d>& points) {
  std::vector<std::uint8_t> wanted = domain.grid.inside;
  for (int layer = 0; layer < kAirLayers; ++layer) {
    const std::vector<std::uint8_t> before = wanted;
    for (std::size_t c = 0; c < before.size(); ++c)
      if (before[c] != 0) for_neighbours(domain.grid, c, [&](std::size_t other) { wanted[other] = 1; });
  }
  for (const Eigen::Vector3d& p : points)
    for (const std::size_t c : domain.stencil(p).cell) wanted[c] = 1;
  return wanted;
}

struct NearestBones {
  double distance = std::numeric_limits<double>::infinity();
  std::vector<int> bones;
};

/// The cells that bones fill, with the nearest bones of each.
std::vector<std::pair<std::size_t, NearestBones>> bone_cells(const SolidGrid& grid, const std::vector<HeatBone>& bones,
                                                             double thickness) {
  const std::vector<float> depth = distance_to_outside(grid);
  std::vector<int> slot(grid.inside.size(), -1);
  std::vector<std::pair<std::size_t, NearestBones>> found;
  const auto offer = [&](std::size_t cell, int bone, double distance) {
    if (slot[cell] < 0) {
      slot[cell] = static_cast<int>(found.size());
      found.emplace_back(cell, NearestBones{});
    }
    NearestBones& nearest = found[slot[cell]].second;
    if (distance < nearest.distance - kTie) nearest = {distance, {}};
    if (distance < nearest.distance + kTie && (nearest.bones.empty() || nearest.bones.back() != bone))
      nearest.bones.push_back(bone);
  };
  for (std::size_t b = 0; b < bones.size(); ++b)
    for (const auto& [from, to] : bones[b].segments) {
      const Eigen::Vector3d along = to - from;
      const double length2 = std::max(along.squaredNorm(), 1e-18);
      const int steps = 1 + static_cast<int>(std::ceil(2 * std::sqrt(length2) / grid.cell));
      for (int s = 0; s <= steps; ++s) {
        const Eigen::Vector3d p = from + (static_cast<double>(s) / steps) * along;
        const Eigen::Vector3i c = grid.cell_of(p);
        const double radius = std::max(0.6 * grid.cell, thickness * depth[grid.index(c.x(), c.y(), c.z())]);
        const int reach = static_cast<int>(std::ceil(radius / grid.cell));
        for (int z = c.z() - reach; z <= c.z() + reach; ++z)
          for (int y = c.y() - reach; y <= c.y() + reach; ++y)
            for (int x = c.x() - reach; x <= c.x() + reach; ++x) {
              if (!grid.contains(x, y, z)) continue;
              const Eigen::Vector3d centre = grid.centre(x, y, z);
              const double t = std::clamp((centre - from).dot(along) / length2, 0.0, 1.0);
              const double distance = (centre - from - t * along).norm();
              const bool here = Eigen::Vector3i(x, y, z) == c;
              if (here || (distance <= radius && grid.is_inside(x, y, z)))
                offer(grid.index(x, y, z), static_cast<int>(b), distance);
            }
      }
    }
  return found;
}

/// Adds the shortest way from every part of the domain that no bone touches to a part with a bone.
void connect_parts(const SolidGrid& grid, const std::vector<std::size_t>& sources, std::vector<std::uint8_t>& wanted) {
  // Cost 0 inside of the domain and 1 outside; `from` leads back to a bone.
  constexpr std::size_t kUnseen = std::numeric_limits<std::size_t>::max();
  std::vector<std::size_t> from(wanted.size(), kUnseen);
  std::deque<std::size_t> queue;
  for (const std::size_t c : sources) {
    from[c] = c;
    queue.push_back(c);
  }
  const auto at_border = [&](std::size_t c) {
    const int x = static_cast<int>(c % as_size(grid.size[0]));
    const int y = static_cast<int>(c / as_size(grid.size[0]) % as_size(grid.size[1]));
    const int z = static_cast<int>(c / as_size(grid.size[0]) / as_size(grid.size[1]));
    return x == 0 || y == 0 || z == 0 || x + 1 == grid.size[0] || y + 1 == grid.size[1] || z + 1 == grid.size[2];
  };
  const std::vector<std::uint8_t> before = wanted;
  while (!queue.empty()) {
    const std::size_t c = queue.front();
    queue.pop_front();
    if (before[c] != 0)
      for (std::size_t back = c; wanted[from[back]] == 0; back = from[back]) wanted[from[back]] = 1;
    if (at_border(c)) continue;
    for_neighbours(grid, c, [&](std::size_t other) {
      if (from[other] != kUnseen) return;
      from[other] = c;
      if (before[other] != 0)
        queue.push_front(other);
      else
        queue.push_back(other);
    });
  }
}

/// Where triangles cross the lines between the centres of neighbouring cells.
std::vector<std::array<std::uint8_t, 3>> find_walls(const SolidGrid& grid, const TriangleMesh& mesh) {
  std::vector<std::array<std::uint8_t, 3>> walls(grid.inside.size(), {0, 0, 0});
  const auto cross2 = [](const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); };
  for (const Triangle& face : mesh.faces)
    for (int axis = 0; axis < 3; ++axis) {
      const int u = (axis + 1) % 3, v = (axis + 2) % 3;
      std::array<Eigen::Vector2d, 3> flat;
      Eigen::Vector3d along;
      for (int k = 0; k < 3; ++k) {
        const Eigen::Vector3d p = (mesh.vertices[face[k]] - grid.origin) / grid.cell;
        flat[k] = {p[u], p[v]};
        along[k] = p[axis];
      }
      const double area = cross2(flat[1] - flat[0], flat[2] - flat[0]);
      if (std::abs(area) < 1e-12) continue;
      const Eigen::Vector2d low = flat[0].cwiseMin(flat[1]).cwiseMin(flat[2]).array().ceil();
      const Eigen::Vector2d high = flat[0].cwiseMax(flat[1]).cwiseMax(flat[2]).array().floor();
      for (double a = low.x(); a <= high.x(); ++a)
        for (double b = low.y(); b <= high.y(); ++b) {
          const Eigen::Vector2d p(a, b);
          const Eigen::Vector3d share(cross2(flat[1] - p, flat[2] - p) / area, cross2(flat[2] - p, flat[0] - p) / area,
                                      cross2(flat[0] - p, flat[1] - p) / area);
          if (share.minCoeff() < 0) continue;
          Eigen::Vector3i cell;
          cell[axis] = static_cast<int>(std::floor(share.dot(along)));
          cell[u] = static_cast<int>(a);
          cell[v] = static_cast<int>(b);
          walls[grid.index(cell.x(), cell.y(), cell.z())][axis] |= area > 0 ? HeatDomain::kOut : HeatDomain::kIn;
        }
    }
  return walls;
}

}  // namespace

HeatDomain::Stencil HeatDomain::stencil(const Eigen::Vector3d& point) const {
  const Eigen::Vector3d scaled = (point - grid.origin) / grid.cell;
  const Eigen::Vector3d low = scaled.array().floor();
  const Eigen::Vector3d share = scaled - low;
  Stencil result;
  for (int corner = 0; corner < 8; ++corner) {
    const int x = corner & 1, y = corner >> 1 & 1, z = corner >> 2;
    result.cell[corner] =
        grid.index(static_cast<int>(low.x()) + x, static_cast<int>(low.y()) + y, static_cast<int>(low.z()) + z);
    result.weight[corner] = (x != 0 ? share.x() : 1 - share.x()) * (y != 0 ? share.y() : 1 - share.y()) *
                            (z != 0 ? share.z() : 1 - share.z());
  }
  return result;
}

HeatDomain make_heat_domain(const TriangleMesh& mesh, const std::vector<HeatBone>& bones, const SolidGrid& solid,
                            const std::vector<Eigen::Vector3d>& points) {
  HeatDomain domain;
  domain.grid = padded(solid, bones, points);
  domain.walls = find_walls(domain.grid, mesh);
  std::vector<std::uint8_t> wanted = wanted_cells(domain, points);
  const auto held = bone_cells(domain.grid, bones, kThickness);
  std::vector<std::size_t> sources;
  for (const auto& entry : held) {
    sources.push_back(entry.first);
    wanted[entry.first] = 1;
  }
  connect_parts(domain.grid, sources, wanted);

  domain.cell_number.assign(wanted.size(), -1);
  for (std::size_t c = 0; c < wanted.size(); ++c) {
    if (wanted[c] == 0) continue;
    domain.cell_number[c] = domain.num_cells();
    domain.cells.push_back(c);
  }
  domain.fixed.resize(domain.cells.size());
  for (const auto& [cell, nearest] : held)
    for (const int bone : nearest.bones)
      domain.fixed[domain.cell_number[cell]].emplace_back(bone, 1.0 / static_cast<double>(nearest.bones.size()));
  return domain;
}

}  // namespace doppel
