#pragma once

#include <cstdint>

#include "doppel/core/cpu_dispatch.h"

namespace doppel::kernels {

/// One Adam update of a flat float array; every pointer covers the whole array.
struct AdamParams {
  float* parameter;
  const float* gradient;
  float* first_moment;
  float* second_moment;
  float* mean;           ///< running mean of the parameter, or null
  float gradient_scale;  ///< clipping
  float shrink;          ///< weight decay: factor on the parameter
  float beta1, beta2;
  float keep1, keep2;  ///< 1 - beta, rounded once: in float, 1 - 0.999f has a relative error of 5e-5
  float step_size;     ///< learning rate / (1 - beta1^t)
  float inverse_root;  ///< 1 / sqrt(1 - beta2^t)
  float epsilon;
  float mean_rate;  ///< share of the new parameter in the mean
};

DOPPEL_DECLARE_KERNEL(void, adam_step, (const AdamParams& p, std::int64_t begin, std::int64_t end))
/// Sum of squares in double. The order of additions depends only on `begin` and `end`.
DOPPEL_DECLARE_KERNEL(double, sum_of_squares, (const float* values, std::int64_t begin, std::int64_t end))

}  // namespace doppel::kernels
