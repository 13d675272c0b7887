#pragma once

#include "doppel/geometry/mesh.h"
#include "doppel/io/scene/scene.h"

namespace doppel {

struct SceneMeshOptions {
  int atlas_side = 4096;  ///< largest width and height of the joined texture, pixels
};

/// All primitives as one mesh, in the scene's coordinates. Vertex i is vertex i of all primitives one after the other.
/// One material with a texture keeps its UVs. Several materials share an atlas: each texture (the part of it that is
/// used), or a patch of the base colour, has its rectangle. Without any texture, the base colours become vertex
/// colours, or nothing if there is but one colour.
/// @param vertices of all primitives, e.g. posed_vertices
TriangleMesh scene_mesh(const Scene& scene, std::vector<Eigen::Vector3d> vertices,
                        const SceneMeshOptions& options = {});
/// As above, with the nodes as the file has them.
TriangleMesh scene_mesh(const Scene& scene, const SceneMeshOptions& options = {});

}  // namespace doppel
