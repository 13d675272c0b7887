#pragma once

#include "doppel/geometry/mesh.h"

namespace doppel {

/// A coarse mesh for the embedded graph of any surface: with several parts, open borders, doubled vertices or edges of
/// many faces, which decimation refuses. Its vertices are template vertices far from one another. Two are joined where
/// the regions of the surface that are nearest to them touch. Every vertex is in a face.
/// @param nodes at least 3, at most the number of different positions
TriangleMesh coarse_mesh(const TriangleMesh& mesh, int nodes);

}  // namespace doppel
