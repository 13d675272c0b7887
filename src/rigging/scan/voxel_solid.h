#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "doppel/geometry/mesh.h"

namespace doppel {

struct VoxelSolidOptions {
  double cell = 0.01;      ///< edge of a cell, in the unit of the mesh (metres)
  int margin = 2;          ///< empty cells around the mesh
  double close_gap = 0.0;  ///< space that the outside reaches only through gaps narrower than this counts as inside
  long most_cells = 64'000'000;  ///< a larger grid is refused; a cell takes 17 bytes
};

/// The inside of a surface with holes, open borders and several overlapping parts, on a grid of cubes.
///
/// A cell is inside where the generalised winding number at its centre (Jacobson et al. 2013; far triangles are summed
/// up as dipoles, Barill et al. 2018) exceeds one half, or where it lies in a large space that the outside cannot
/// reach. The depth of a cell is the distance of its centre to the surface between inside and outside; surfaces within
/// the solid (a body under a coat) do not count.
class VoxelSolid {
 public:
  using Cell = std::array<int, 3>;

  /// @param mesh faces counter-clockwise from outside, as repair() leaves them
  /// @throws UsageError for a mesh without faces, with wrong indices or positions that are not finite, for a cell that
  ///   is not positive, and when the grid would have more than `most_cells` cells (the message names a cell that fits)
  explicit VoxelSolid(const TriangleMesh& mesh, const VoxelSolidOptions& options = {});

  const Eigen::Vector3d& origin() const { return origin_; }  ///< the lowest corner of cell (0,0,0)
  double cell_size() const { return cell_; }
  const Cell& dims() const { return dims_; }
  int num_cells() const { return static_cast<int>(depth_.size()); }

  /// Cells are numbered with x fastest.
  int index(const Cell& c) const { return (c[2] * dims_[1] + c[1]) * dims_[0] + c[0]; }
  Cell cell_of(int index) const;
  Eigen::Vector3d centre(int index) const;

  bool inside_cell(int index) const { return inside_[static_cast<std::size_t>(index)] != 0; }
  /// Distance of the cell's centre to the surface, negative outside.
  double cell_depth(int index) const { return static_cast<double>(depth_[static_cast<std::size_t>(index)]); }
  /// The cells inside, ascending.
  const std::vector<int>& inside_cells() const { return inside_cells_; }
  /// The six neighbours over the faces -x +x -y +y -z +z; -1 beyond the grid.
  std::array<int, 6> neighbours(int index) const;

  /// Whether the depth at a point is positive.
  bool inside(const Eigen::Vector3d& point) const { return depth(point) > 0.0; }
  /// Distance to the surface, negative outside, interpolated between cells. Beyond the grid: the depth at the grid's
  /// border less the distance to it.
  double depth(const Eigen::Vector3d& point) const;

  double volume() const;  ///< of the inside cells

 private:
  void size_grid(const TriangleMesh& mesh, const VoxelSolidOptions& options);
  void measure_depth(const TriangleMesh& mesh);

  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
  double cell_ = 0.0;
  Cell dims_{};
  std::vector<std::uint8_t> inside_;
  std::vector<float> depth_;
  std::vector<int> inside_cells_;
};

}  // namespace doppel
