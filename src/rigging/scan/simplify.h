#pragma once

#include <cstddef>
#include <string>

#include "doppel/geometry/mesh.h"

namespace doppel {

struct SimplifyOptions {
  int target_faces = 0;     ///< stop at this number of triangles; 0: no limit
  int target_vertices = 0;  ///< stop at this number of vertices; 0: no limit. One of both is needed.
  /// Weight of the distance (in the mesh's unit) by which the texture slides over the surface, against that by which
  /// the surface moves.
  double texture_weight = 0.1;
  std::size_t memory_limit = std::size_t{8} << 30;  ///< bytes; a mesh that needs more is refused
};

struct SimplifyReport {
  int faces = 0, vertices = 0;
  bool reached = true;   ///< false: no further edge could go
  std::string sentence;  ///< "simplified 93058 triangles to 10000"
};

/// Bytes that simplify needs besides the mesh itself. For meshes from scanners (V = F / 2), 0.26 kB per triangle.
std::size_t simplify_memory(const TriangleMesh& mesh);

/// Quadric edge collapse (Garland & Heckbert 1997) that keeps borders, UV seams and colours. A new vertex lies on the
/// edge or straight above it, and takes its colour and UVs from the edge. Vertices on a border or seam move along it
/// only, in the surface and in the texture. No triangle of the surface or of the texture turns over. Deterministic.
/// @param mesh repaired; edges of more than two faces stay
/// @throws UsageError without a target, for a target below 4, for wrong indices or positions that are not finite, and
///   when simplify_memory exceeds the limit
TriangleMesh simplify(const TriangleMesh& mesh, const SimplifyOptions& options, SimplifyReport* report = nullptr);

}  // namespace doppel
