#pragma once

#include <cstdint>

#include "doppel/core/cpu_dispatch.h"

namespace doppel::kernels {

/// The maps of a residual texture, each [3,map_size] but for `lighting` [3,9].
struct ResidualTextureParams {
  const float *residual, *albedo;
  const float *normals, *lighting;  ///< null: the albedo is not lit
  std::int64_t map_size;
  float* texture;  ///< [map_size,3]
};

/// Texels [begin,end). Equation: residual_texture (residual_texture.h)
DOPPEL_DECLARE_KERNEL(void, residual_texture, (const ResidualTextureParams& p, std::int64_t begin, std::int64_t end))

}  // namespace doppel::kernels
