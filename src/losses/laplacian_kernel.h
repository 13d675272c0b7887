#pragma once

#include <cstdint>

#include "doppel/core/cpu_dispatch.h"

namespace doppel {

/// Laplacian loss of one item of the batch (laplacian.h has the equation).
struct LaplacianParams {
  int64_t num_vertices;
  const int32_t* offsets;  ///< [N+1] rows of neighbours
  const int32_t* neighbours;
  const float* weight;   ///< [N]
  const float* refined;  ///< [N,3] V_fi
  const float* coarse;   ///< [N,3] V_co
  float* displacement;   ///< [N,4] scratch
  float* laplacian;      ///< [N,4] scratch: w_i times the Laplacian of vertex i
  double sum;            ///< out
  float scale;           ///< of the gradient: dL/d(sum)
  float* gradient;       ///< [N,3], or null when only the sum is wanted
};

namespace kernels {

DOPPEL_DECLARE_KERNEL(void, laplacian_item, (LaplacianParams & p))

}  // namespace kernels
}  // namespace doppel
