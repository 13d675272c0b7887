#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "doppel/geometry/mesh.h"
#include "doppel/rigging/weights/heat_bone.h"
#include "doppel/rigging/weights/solid_grid.h"

namespace doppel {

/// The cells in which heat flows: those inside of the body, a layer of air around them, and all cells that a vertex or
/// a bone touches. Every cell is connected with a bone.
struct HeatDomain {
  /// A surface between two neighbouring cells: the way along the axis leads out of it (1), into it (2), or both.
  enum Wall : std::uint8_t { kNone = 0, kOut = 1, kIn = 2, kGap = 3 };
  SolidGrid grid;  ///< the solid, padded so that all vertices and bones lie inside of it
  std::vector<std::array<std::uint8_t, 3>>
      walls;                       ///< [cells of the grid] towards the next cell along x, y, z: Wall bits
  std::vector<int> cell_number;    ///< [cells of the grid] number of the cell in the domain, or -1
  std::vector<std::size_t> cells;  ///< [n] cell of the grid
  std::vector<std::vector<std::pair<int, double>>> fixed;  ///< [n] bones that pass through the cell, with shares

  int num_cells() const { return static_cast<int>(cells.size()); }
  /// The cells around a point and their trilinear weights.
  struct Stencil {
    std::array<std::size_t, 8> cell;
    std::array<double, 8> weight;
  };
  Stencil stencil(const Eigen::Vector3d& point) const;
};

/// @param mesh whose surface hinders the heat @param points positions at which the temperature will be read
HeatDomain make_heat_domain(const TriangleMesh& mesh, const std::vector<HeatBone>& bones, const SolidGrid& solid,
                            const std::vector<Eigen::Vector3d>& points);

/// Solves for the steady temperature: [n * bones], row-major, cell by cell.
std::vector<float> solve_heat(const HeatDomain& domain, int num_bones);

}  // namespace doppel
