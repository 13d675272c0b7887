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

constexpr double kBlur = 0.3;  ///< square pixels, added to both axes
constexpr double kMinAlpha = 1.0 / 255;
constexpr double kMaxAlpha = 0.99;
constexpr double kMinTransmittance = 1e-4;
constexpr double kOutside = 0.15;                        ///< of the image: J stays constant beyond
constexpr double kMinLength = 1e-12, kMaxLength = 1e12;  ///< of a quaternion
constexpr double kBeyond = 1048576;                      ///< pixels: no Gaussian is drawn beyond

SplatImage reference(const Splats& splats, const Cameras& cameras, std::int64_t height, std::int64_t width,
                     const SplatOptions& options);
SplatImage fused(const Splats& splats, const Cameras& cameras, std::int64_t height, std::int64_t width,
                 const SplatOptions& options);

}  // namespace doppel::splats
