#pragma once

#include <cstdint>

#include "doppel/core/cpu_dispatch.h"

namespace doppel {

/// ARAP of up to `lanes` items of the batch at once (arap.h has the equation).
struct ArapParams {
  int64_t num_nodes;
  const int32_t* offsets;  ///< [K+1] rows of neighbours
  const int32_t* targets;
  const float* rigidity;  ///< [E]
  const float* rest;      ///< [E,3], target minus source
  int64_t first;
  int count, lanes;
  const float* angles;        ///< [B,K,3]
  const float* translations;  ///< [B,K,3]
  float* table;               ///< [K,12,lanes]: R - I row by row, then T; filled by arap_prepare
  double* sums;               ///< forward: [blocks of 16 nodes] sums over edges and items
  float scale;                ///< backward: dL/d(sum of an edge)
  float* grad_angles;
  float* grad_translations;
};

namespace kernels {

DOPPEL_DECLARE_KERNEL(int, arap_lanes, (int64_t count))
/// Nodes [begin,end), begin a multiple of 16, in all three.
DOPPEL_DECLARE_KERNEL(void, arap_prepare, (const ArapParams& p, int64_t begin, int64_t end))
DOPPEL_DECLARE_KERNEL(void, arap_forward, (const ArapParams& p, int64_t begin, int64_t end))
DOPPEL_DECLARE_KERNEL(void, arap_backward, (const ArapParams& p, int64_t begin, int64_t end))

}  // namespace kernels
}  // namespace doppel
