#pragma once

#include "doppel/geometry/mesh.h"

namespace doppel {

/// Computes UVs per corner of the mesh. Triangles that face one of the six axis directions form charts. Each chart is
/// projected along its axis; all charts have one scale and are packed into the unit square. No two triangles overlap: a
/// chart takes a triangle only if the area of its projection is free.
/// @param gutter free space around every chart, in units of the square
void unwrap(TriangleMesh& mesh, double gutter);

}  // namespace doppel
