#pragma once

#include <array>
#include <functional>
#include <vector>

#include "doppel/geometry/distance_field.h"
#include "doppel/geometry/mesh.h"

namespace doppel {

/// The planes of a grid along one axis.
struct GridLine {
  std::vector<double> planes;  ///< [n] coordinates, ascending, metres
  /// [n] From each plane to the next; the last one is not used. Differences of planes are rounded, and surfaces on even
  /// grids must not depend on that.
  std::vector<double> cells;
};
/// Along x, y and z.
using GridLines = std::array<GridLine, 3>;
/// Planes `cell` metres apart over a box.
GridLines regular_lines(const Eigen::Vector3d& low, const Eigen::Vector3d& high, double cell);
/// Replaces the planes that cut a box, along each axis, by planes `cell` metres apart or less.
/// @throws Error for a box without extent, or a cell that is not above 0
void refine_lines(GridLines& lines, const Eigen::Vector3d& low, const Eigen::Vector3d& high, double cell);

/// Meshes the zero level of a field by surface nets: one vertex per grid cell and one quad per grid edge that the
/// surface crosses. The field is called by several threads at once.
/// @param lines of a grid that holds the surface
/// @return one closed triangle mesh without handles, counter-clockwise from outside
/// @throws Error when the grid is too coarse to give a manifold, or the surface has several parts or holes
TriangleMesh mesh_field(const DistanceField& field, const GridLines& lines);
/// The same on a grid of cubes.
/// @param low, high a box that holds the surface, metres @param cell edge of a grid cell, metres
TriangleMesh mesh_field(const DistanceField& field, const Eigen::Vector3d& low, const Eigen::Vector3d& high,
                        double cell);

/// Collapses edges, shortest first, until `target_vertices` are left, and distributes the vertices evenly over the
/// surface. The mesh stays a manifold of the same genus.
/// @param relative_size relative edge length at a point (0.5: twice as dense)
TriangleMesh coarsen(const TriangleMesh& mesh, const DistanceField& field, int target_vertices,
                     const std::function<double(const Eigen::Vector3d&)>& relative_size);

}  // namespace doppel
