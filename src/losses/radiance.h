#pragma once

/// The loss of a radiance field:
///
///   L = L_colour + L_mask + lambda L_variance                                     (6.28)
///   L_colour   = mean over rays of |c - F c_gt|^2                                 (6.23)
///   L_mask     = mean over rays of (sum of w - F)^2                               (6.29)
///   L_variance = mean over rays of Var^2                                          (6.30)
///
/// F is the mask, c_gt the image, c is composited on black. Var is the variance of RenderedRays, with weights w. 6.31
/// prints alpha instead, which would count samples hidden behind an opaque surface.
/// Letters: R rays.

#include <torch/types.h>

#include "doppel/layers/volume_rendering/volume_rendering.h"

namespace doppel {

struct RadianceLossOptions {
  double variance_weight = 0.01;  ///< lambda; 0.1 from the second round on
  /// The variance in square metres instead of squares of the interval. On an interval of 10 cm it is then below 2.5e-3,
  /// and its square is negligible beside the colours.
  bool variance_in_metres = false;
};

struct RadianceLoss {
  torch::Tensor colour, mask, variance;  ///< scalars >= 0, unweighted
  torch::Tensor total;                   ///< L of 6.28
  std::int64_t rays = 0;                 ///< R, the number of rays that the means are over
};

/// @param rays of render_volume with 3 colour channels
/// @param samples from which the rays were rendered
/// @param image [R,3] RGB 0..1 @param mask [R] 0..1, may be soft
/// Gradients: to `rays`. Without rays all losses are 0.
/// @throws UsageError naming the argument, with the shape found
RadianceLoss radiance_loss(const RenderedRays& rays, const RaySamples& samples, const torch::Tensor& image,
                           const torch::Tensor& mask, const RadianceLossOptions& options = {});

}  // namespace doppel
