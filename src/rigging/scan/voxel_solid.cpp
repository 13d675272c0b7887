#include "doppel/rigging/scan/voxel_solid.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/core/utility.hpp>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/geometry/triangle_tree.h"
#include "doppel/rigging/scan/scan_parts.h"
#include "doppel/rigging/scan/voxel_parts.h"
#include "doppel/rigging/scan/winding_number.h"

namespace doppel {
namespace {

using Eigen::Vector3d;
using Cell = VoxelSolid::Cell;

/// The grid starts at an odd fraction of a cell, so that the faces of man-made shapes do not run through centres.
constexpr double kOddStart = 0.377;
/// Cells of a block whose corners agree and which no surface crosses take the winding number of the corners.
constexpr int kBlock = 4;
constexpr double kClearlyOutside = 0.25, kClearlyInside = 0.75;
/// An enclosed space that the winding number calls outside is inside after all if it is larger than this share of the
/// solid: then the winding is wrong. Smaller ones are folds, such as that of an arm at the trunk.
constexpr double kLargeSpace = 0.02;
/// The surface of a border cell is looked for within its half diagonal.
constexpr double kHalfDiagonal = 0.9;

/// The winding number at the corners of all blocks, and the cells where it exceeds one half.
class WindingGrid {
 public:
  WindingGrid(const VoxelSolid& grid, const TriangleMesh& mesh, const std::vector<std::uint8_t>& surface)
      : grid_(grid), winding_(mesh), surface_(surface) {
    for (int k = 0; k < 3; ++k) blocks_[k] = (grid.dims()[k] + kBlock - 1) / kBlock;
    corners_.resize(as_size(blocks_[0] + 1) * as_size(blocks_[1] + 1) * as_size(blocks_[2] + 1));
  }

  void fill(std::vector<std::uint8_t>& inside) {
    cv::parallel_for_(cv::Range(0, blocks_[2] + 1), [&](const cv::Range& layers) {
      for (int z = layers.start; z < layers.end; ++z)
        for (int y = 0; y <= blocks_[1]; ++y)
          for (int x = 0; x <= blocks_[0]; ++x)
            corners_[corner({x, y, z})] = static_cast<float>(
                std::abs(winding_.at(grid_.origin() + kBlock * grid_.cell_size() * Vector3d(x, y, z))));
    });
    cv::parallel_for_(cv::Range(0, blocks_[2]), [&](const cv::Range& layers) {
      for (int z = layers.start; z < layers.end; ++z)
        for (int y = 0; y < blocks_[1]; ++y)
          for (int x = 0; x < blocks_[0]; ++x) fill_block({x, y, z}, inside);
    });
  }

 private:
  std::size_t corner(const Cell& c) const {
    return (as_size(c[2]) * as_size(blocks_[1] + 1) + as_size(c[1])) * as_size(blocks_[0] + 1) + as_size(c[0]);
  }

  template <typename Action>
  void for_cells(const Cell& block, const Action& action) const {
    Cell low, high;
    for (int k = 0; k < 3; ++k) {
      low[k] = block[k] * kBlock;
      high[k] = std::min(low[k] + kBlock, grid_.dims()[k]);
    }
    for (int z = low[2]; z < high[2]; ++z)
      for (int y = low[1]; y < high[1]; ++y)
        for (int x = low[0]; x < high[0]; ++x) action(grid_.index({x, y, z}));
  }

  void fill_block(const Cell& block, std::vector<std::uint8_t>& inside) const {
    double low = std::numeric_limits<double>::infinity(), high = 0.0;
    for (int k = 0; k < 8; ++k) {
      const double w = static_cast<double>(
          corners_[corner({block[0] + (k & 1), block[1] + ((k >> 1) & 1), block[2] + ((k >> 2) & 1)})]);
      low = std::min(low, w);
      high = std::max(high, w);
    }
    bool crossed = false;
    for_cells(block, [&](int cell) { crossed = crossed || surface_[cell] != 0; });
    if (!crossed && high < kClearlyOutside) return;
    if (!crossed && low > kClearlyInside) return for_cells(block, [&](int cell) { inside[cell] = 1; });
    for_cells(block, [&](int cell) { inside[cell] = std::abs(winding_.at(grid_.centre(cell))) > 0.5; });
  }

  const VoxelSolid& grid_;
  WindingNumber winding_;
  const std::vector<std::uint8_t>& surface_;
  Cell blocks_{};
  std::vector<float> corners_;
};

/// Adds large spaces that the outside cannot reach, through gaps wider than 2 `radius` cells.
void fill_enclosed(const VoxelSolid& grid, const std::vector<std::uint8_t>& surface, int radius,
                   std::vector<std::uint8_t>& inside) {
  const VoxelLayout layout{grid.dims()};
  std::vector<std::uint8_t> wall = radius > 0 ? dilated(layout, surface, radius) : surface;
  const std::vector<std::vector<int>> spaces = enclosed_spaces(layout, wall);
  std::size_t solid = 0, enclosed = 0;
  for (const std::uint8_t cell : inside) solid += cell;
  for (const auto& space : spaces) enclosed += space.size();
  std::vector<std::uint8_t> core(inside.size(), 0);
  bool any = false;
  for (const std::vector<int>& space : spaces) {
    if (static_cast<double>(space.size()) < kLargeSpace * static_cast<double>(std::max(solid, enclosed))) continue;
    for (const int cell : space) core[cell] = 1;
    any = true;
  }
  if (!any) return;
  if (radius > 0) core = dilated(layout, core, radius);
  for (std::size_t i = 0; i < inside.size(); ++i)
    if (core[i] != 0 && surface[i] == 0) inside[i] = 1;
}

/// The nearest surface point of each cell, spread from cell to cell in eight sweeps over the grid.
class NearestPoints {
 public:
  explicit NearestPoints(const VoxelSolid& grid) : grid_(grid), points_(as_size(grid.num_cells()), nowhere()) {}

  void set(int cell, const Vector3d& point) { points_[cell] = point.cast<float>(); }

  void spread() {
    const Cell& n = grid_.dims();
    for (int sweep = 0; sweep < 8; ++sweep) {
      const Cell step{sweep & 1 ? -1 : 1, sweep & 2 ? -1 : 1, sweep & 4 ? -1 : 1};
      for (int k = 0, z = step[2] > 0 ? 0 : n[2] - 1; k < n[2]; ++k, z += step[2])
        for (int j = 0, y = step[1] > 0 ? 0 : n[1] - 1; j < n[1]; ++j, y += step[1])
          for (int i = 0, x = step[0] > 0 ? 0 : n[0] - 1; i < n[0]; ++i, x += step[0]) take_best({x, y, z}, step);
    }
  }

  /// Infinite where there is no surface at all.
  float distance(int cell) const { return (points_[cell] - grid_.centre(cell).cast<float>()).norm(); }

 private:
  static Eigen::Vector3f nowhere() { return Eigen::Vector3f::Constant(std::numeric_limits<float>::infinity()); }

  void take_best(const Cell& cell, const Cell& step) {
    const int here = grid_.index(cell);
    const Eigen::Vector3f centre = grid_.centre(here).cast<float>();
    float best = (points_[here] - centre).squaredNorm();
    for (int neighbour = 1; neighbour < 8; ++neighbour) {
      Cell other = cell;
      bool valid = true;
      for (int k = 0; k < 3; ++k) {
        if (neighbour >> k & 1) other[k] -= step[k];
        valid = valid && other[k] >= 0 && other[k] < grid_.dims()[k];
      }
      if (!valid) continue;
      const Eigen::Vector3f& candidate = points_[grid_.index(other)];
      const float distance = (candidate - centre).squaredNorm();
      if (distance < best) {
        best = distance;
        points_[here] = candidate;
      }
    }
  }

  const VoxelSolid& grid_;
  std::vector<Eigen::Vector3f> points_;
};

void check_solid_input(const TriangleMesh& mesh, const VoxelSolidOptions& options) {
  check_scan_mesh(mesh, "finding the inside of a mesh");
  for (const Triangle& face : mesh.faces)
    for (const int v : face)
      if (!mesh.vertices[v].allFinite())
        fail<UsageError>("finding the inside of a mesh: vertex {} is not finite; repair the mesh first", v);
  if (!(options.cell > 0.0) || options.margin < 1)
    fail<UsageError>("finding the inside of a mesh: the cell is {} and the margin {}, both must be positive",
                     options.cell, options.margin);
}

}  // namespace

VoxelSolid::VoxelSolid(const TriangleMesh& mesh, const VoxelSolidOptions& options) {
  check_solid_input(mesh, options);
  size_grid(mesh, options);
  const VoxelLayout layout{dims_};
  const std::vector<std::uint8_t> surface = crossed_cells(layout, origin_, cell_, mesh);
  inside_.assign(layout.size(), 0);
  depth_.assign(layout.size(), 0.0f);
  WindingGrid(*this, mesh, surface).fill(inside_);
  const int radius = options.close_gap > 0.0 ? static_cast<int>(std::ceil(0.5 * options.close_gap / cell_)) : 0;
  fill_enclosed(*this, surface, radius, inside_);
  for (int i = 0; i < num_cells(); ++i)
    if (inside_cell(i)) inside_cells_.push_back(i);
  measure_depth(mesh);
}

void VoxelSolid::size_grid(const TriangleMesh& mesh, const VoxelSolidOptions& options) {
  Vector3d low = mesh.vertices[mesh.faces[0][0]], high = low;
  for (const Triangle& face : mesh.faces)
    for (const int v : face) {
      low = low.cwiseMin(mesh.vertices[v]);
      high = high.cwiseMax(mesh.vertices[v]);
    }
  cell_ = options.cell;
  origin_ = low - Vector3d::Constant((options.margin + kOddStart) * cell_);
  const Vector3d cells = ((high - origin_) / cell_).array() + options.margin + 1.0;
  const double count = cells.prod();
  if (!(count <= static_cast<double>(options.most_cells))) {
    const double fitting = cell_ * std::cbrt(count / static_cast<double>(options.most_cells)) * 1.05;
    fail<UsageError>(
        "finding the inside of a mesh: {:.3g} x {:.3g} x {:.3g} large, cells of {} make {:.3g} cells, at most {} are "
        "allowed; check the unit of the mesh, or use cells of {:.2g}",
        high.x() - low.x(), high.y() - low.y(), high.z() - low.z(), cell_, count, options.most_cells, fitting);
  }
  for (int k = 0; k < 3; ++k) dims_[k] = static_cast<int>(cells[k]);
}

void VoxelSolid::measure_depth(const TriangleMesh& mesh) {
  std::vector<int> border;
  for (int i = 0; i < num_cells(); ++i)
    for (const int n : neighbours(i))
      if (n >= 0 && inside_cell(n) != inside_cell(i)) {
        border.push_back(i);
        break;
      }
  NearestPoints nearest(*this);
  const TriangleTree tree(mesh.vertices, mesh.faces);
  cv::parallel_for_(cv::Range(0, static_cast<int>(border.size())), [&](const cv::Range& range) {
    for (int b = range.start; b < range.end; ++b) {
      const int cell = border[b];
      const Vector3d middle = centre(cell);
      const TriangleTree::Hit hit = tree.closest(middle);
      Vector3d point = Vector3d::Zero();
      const Triangle& face = mesh.faces[hit.face];
      for (int k = 0; k < 3; ++k) point += hit.weights[k] * mesh.vertices[face[k]];
      if (hit.squared_distance > std::pow(kHalfDiagonal * cell_, 2)) {
        // In a hole there is no surface: the border runs between the two cells.
        const std::array<int, 6> around = neighbours(cell);
        const auto other = std::find_if(around.begin(), around.end(),
                                        [&](int n) { return n >= 0 && inside_cell(n) != inside_cell(cell); });
        point = 0.5 * (middle + centre(*other));
      }
      nearest.set(cell, point);
    }
  });
  nearest.spread();
  const float farthest = static_cast<float>(cell_ * (dims_[0] + dims_[1] + dims_[2]));
  for (int i = 0; i < num_cells(); ++i) {
    const float distance = std::min(nearest.distance(i), farthest);
    depth_[i] = inside_cell(i) ? distance : -distance;
  }
}

Cell VoxelSolid::cell_of(int index) const {
  return {index % dims_[0], index / dims_[0] % dims_[1], index / (dims_[0] * dims_[1])};
}

Vector3d VoxelSolid::centre(int index) const {
  const Cell c = cell_of(index);
  return origin_ + cell_ * Vector3d(c[0] + 0.5, c[1] + 0.5, c[2] + 0.5);
}

std::array<int, 6> VoxelSolid::neighbours(int index) const {
  const Cell c = cell_of(index);
  const std::array<int, 3> stride{1, dims_[0], dims_[0] * dims_[1]};
  std::array<int, 6> out;
  for (int k = 0; k < 3; ++k) {
    out[2 * k] = c[k] > 0 ? index - stride[k] : -1;
    out[2 * k + 1] = c[k] + 1 < dims_[k] ? index + stride[k] : -1;
  }
  return out;
}

double VoxelSolid::depth(const Vector3d& point) const {
  const Vector3d low = origin_ + Vector3d::Constant(0.5 * cell_),
                 high = low + cell_ * Vector3d(dims_[0] - 1, dims_[1] - 1, dims_[2] - 1);
  const Vector3d clamped = point.cwiseMax(low).cwiseMin(high), position = (clamped - low) / cell_;
  Cell first;
  Vector3d t;
  for (int k = 0; k < 3; ++k) {
    first[k] = std::clamp(static_cast<int>(position[k]), 0, dims_[k] - 2);
    t[k] = position[k] - first[k];
  }
  double sum = 0.0;
  for (int k = 0; k < 8; ++k) {
    const Cell cell{first[0] + (k & 1), first[1] + (k >> 1 & 1), first[2] + (k >> 2 & 1)};
    const double weight = (k & 1 ? t[0] : 1.0 - t[0]) * (k & 2 ? t[1] : 1.0 - t[1]) * (k & 4 ? t[2] : 1.0 - t[2]);
    sum += weight * cell_depth(index(cell));
  }
  return sum - (point - clamped).norm();
}

double VoxelSolid::volume() const { return static_cast<double>(inside_cells_.size()) * std::pow(cell_, 3); }

}  // namespace doppel
