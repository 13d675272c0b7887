#pragma once

#include <torch/types.h>

#include "doppel/render/splats/splat_types.h"

/// Kernel and reference of `draw_splats`, with checked arguments.
namespace doppel::splats {

/// Cameras in double precision, whatever the type of the Gaussians.
struct Cameras {
  torch::Tensor projection;  ///< float64 [B,C,3,4], scaled so that the last row gives metres; 0: draws nothing
  torch::Tensor centre;      ///< float64 [B,C,3]
};

SplatImage reference(const Splats& splats, const Cameras& cameras, std::int64_t height, std::int64_t width,
                     const SplatOptions& options);
SplatImage fused(const Splats& splats, const Cameras& cameras, std::int64_t height, std::int64_t width,
                 const SplatOptions& options);

}  // namespace doppel::splats
