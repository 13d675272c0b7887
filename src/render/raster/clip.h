#pragma once

#include <vector>

#include "doppel/render/raster/raster_kernel.h"

namespace doppel::render {

/// Cuts a face by the near plane and the guard band and appends the remaining triangles (at most six). Neighbouring
/// faces have the same points on their common edge, bit for bit.
void cut_face(const kernels::RasterView& view, std::int32_t face, std::vector<kernels::CutTriangle>& out);

}  // namespace doppel::render
