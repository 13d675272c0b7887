#pragma once

#include <cstdint>

#include "doppel/core/cpu_dispatch.h"

namespace doppel {

/// One layer; the outputs are in panels of dense_panel() neighbours.
struct DenseLayerParams {
  int64_t inputs, outputs, panels;
  const float* weight;  ///< [panels,inputs,dense_panel()]
  const float* bias;    ///< [panels * dense_panel()]
  bool rectified;       ///< negative outputs become 0
};

namespace kernels {

DOPPEL_DECLARE_KERNEL(int64_t, dense_panel, ())
/// Floats of scratch memory.
DOPPEL_DECLARE_KERNEL(int64_t, dense_layers_scratch, (const DenseLayerParams* layers, int count))
/// @param points [P,inputs of the first] @param out [P,outputs of the last]
DOPPEL_DECLARE_KERNEL(void, dense_layers,
                      (const DenseLayerParams* layers, int count, const float* points, int64_t num_points, float* out,
                       float* scratch))

}  // namespace kernels
}  // namespace doppel
