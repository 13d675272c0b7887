#pragma once

#include "doppel/geometry/mesh.h"

namespace doppel::synth {

/// Gives the mesh UVs per corner: charts of triangles that look in one of the six axis directions, each projected
/// along its axis, scaled alike and packed into the unit square. No two triangles overlap: a chart takes a triangle
/// only while its projection is free.
/// @param gutter free space around every chart, in units of the square
void unwrap(TriangleMesh& mesh, double gutter);

}  // namespace doppel::synth
