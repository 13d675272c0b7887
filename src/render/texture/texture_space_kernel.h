#pragma once

#include <cstdint>

#include "doppel/core/cpu_dispatch.h"

namespace doppel::kernels {

/// The texels of a map that have a value, in runs of neighbours within a row.
struct TexelTable {
  const std::int32_t* runs;     ///< [R,2] first texel of the run in the map, its first texel in the arrays below
  const std::int32_t* corners;  ///< [3,Q] vertices
  const float* weights;         ///< [3,Q] barycentrics
  std::int64_t num_runs, num_texels;
  std::int64_t map_size;  ///< texels of the map
};

/// Unit normals of the runs [begin,end), and 0 between them and their predecessors; the last run is followed by 0.
/// @param normals [N,4] sums of the face normals at a vertex @param map [3,map_size]
DOPPEL_DECLARE_KERNEL(void, texel_normals,
                      (const TexelTable& table, const float* normals, std::int64_t begin, std::int64_t end, float* map))

}  // namespace doppel::kernels
