#pragma once

#include <vector>

#include "doppel/geometry/mesh.h"

namespace doppel {

/// A closed line of border edges: vertex i to vertex i+1 is an edge of a face.
struct BorderLoop {
  std::vector<int> halves;  ///< as in edge_table.h
  double length = 0.0;
};

/// The border lines of a mesh in which every border vertex has one border edge that begins there.
/// @param across [3 F] the half beyond each half, or -1
std::vector<BorderLoop> border_loops(const TriangleMesh& mesh, const std::vector<int>& across);

/// The triangles of least area over a border line that add no edge which the mesh already has; empty if there are none.
/// @param line vertices in the order of the border's halves @param has_edge whether the mesh has an edge
/// @param area receives the area
std::vector<Triangle> least_area_triangles(const std::vector<Eigen::Vector3d>& line,
                                           const std::vector<std::vector<bool>>& has_edge, double& area);

}  // namespace doppel
