#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "doppel/geometry/mesh.h"

namespace doppel {

/// The numbering of the cells of a grid, x fastest.
struct VoxelLayout {
  std::array<int, 3> dims;

  std::size_t size() const {
    return static_cast<std::size_t>(dims[0]) * static_cast<std::size_t>(dims[1]) * static_cast<std::size_t>(dims[2]);
  }
  int index(int x, int y, int z) const { return (z * dims[1] + y) * dims[0] + x; }
};

/// 1 for each cell that a triangle touches. @param origin the lowest corner of cell (0,0,0); the mesh lies in the grid
std::vector<std::uint8_t> crossed_cells(const VoxelLayout& layout, const Eigen::Vector3d& origin, double cell,
                                        const TriangleMesh& mesh);

/// The cells within `radius` cells of a marked cell along each axis.
std::vector<std::uint8_t> dilated(const VoxelLayout& layout, const std::vector<std::uint8_t>& cells, int radius);

/// The connected sets (over faces) of cells that are no wall and that the border of the grid does not reach.
std::vector<std::vector<int>> enclosed_spaces(const VoxelLayout& layout, const std::vector<std::uint8_t>& wall);

}  // namespace doppel
