#pragma once

#include "doppel/geometry/mesh.h"
#include "doppel/rigging/weights/solid_grid.h"

namespace doppel {

/// The surface of a solid: closed and manifold, faces counter-clockwise from outside. Marching tetrahedra on a grid of
/// twice the cell size. Parts with less than a twentieth of the vertices of the largest part are left out, and so are
/// details smaller than about three cells.
/// @throws Error for an empty solid
TriangleMesh solid_surface(const SolidGrid& solid);

}  // namespace doppel
