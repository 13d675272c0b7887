#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "doppel/geometry/mesh.h"

namespace doppel {

/// A mesh as graphics cards take it: a vertex with several UVs is split.
struct ViewMesh {
  std::vector<std::uint32_t> corners;  ///< [3F] split vertices
  std::vector<std::uint32_t> source;   ///< [S] vertex of the mesh
  std::vector<float> uvs;              ///< [S,2]; zero for a mesh without UVs
};

ViewMesh split_at_seams(const TriangleMesh& mesh);

/// The bytes of `mesh.bin` (view_files.h).
std::string view_mesh_bytes(const ViewMesh& mesh);

}  // namespace doppel
