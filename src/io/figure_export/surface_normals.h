#pragma once

#include <vector>

#include "doppel/geometry/mesh.h"

namespace doppel {

/// Unit normals [N] of a mesh whose vertices are moved; upwards for vertices without area.
/// @param moved displacements [N, 3], metres, or null
std::vector<Eigen::Vector3d> surface_normals(const TriangleMesh& mesh, const Eigen::MatrixX3f* moved);

}  // namespace doppel
