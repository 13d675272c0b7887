#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "doppel/rigging/scan/voxel_solid.h"

namespace doppel {

/// The space inside a body as cubes of one size.
struct SolidGrid {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  ///< centre of cell (0, 0, 0), metres
  double cell = 0.008;                               ///< side of a cell, metres
  std::array<int, 3> size{0, 0, 0};                  ///< cells along x, y, z
  std::vector<std::uint8_t> inside;                  ///< [x + size[0] * (y + size[1] * z)] 1 inside of the body

  std::size_t index(int x, int y, int z) const {
    return static_cast<std::size_t>(x) +
           static_cast<std::size_t>(size[0]) *
               (static_cast<std::size_t>(y) + static_cast<std::size_t>(size[1]) * static_cast<std::size_t>(z));
  }
  bool contains(int x, int y, int z) const {
    return x >= 0 && y >= 0 && z >= 0 && x < size[0] && y < size[1] && z < size[2];
  }
  bool is_inside(int x, int y, int z) const { return contains(x, y, z) && inside[index(x, y, z)] != 0; }
  Eigen::Vector3d centre(int x, int y, int z) const { return origin + cell * Eigen::Vector3d(x, y, z); }
  /// The cell that holds a point; it may lie outside of the grid.
  Eigen::Vector3i cell_of(const Eigen::Vector3d& point) const {
    return ((point - origin) / cell).array().round().cast<int>();
  }
  bool is_inside(const Eigen::Vector3d& point) const {
    const Eigen::Vector3i c = cell_of(point);
    return is_inside(c.x(), c.y(), c.z());
  }
};

/// Distance of each inside cell's centre from the nearest cell outside, metres; 0 outside.
std::vector<float> distance_to_outside(const SolidGrid& grid);

/// The inside cells of a voxel solid.
SolidGrid solid_grid(const VoxelSolid& solid);

}  // namespace doppel
