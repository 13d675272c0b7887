#pragma once

#include <Eigen/Core>

#include "doppel/geometry/mesh.h"

namespace doppel {

/// The colour of every vertex: its own where the mesh has colours, else that of the blurred texture, averaged over the
/// vertex's corners. @return [3,N] RGB 0..1; no columns when the mesh has neither
Eigen::Matrix3Xd vertex_colours(const TriangleMesh& mesh);

}  // namespace doppel
