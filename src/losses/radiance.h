#pragma once

/// What a radiance field is trained with:
///
///   L = L_colour + L_mask + lambda L_variance                                     (6.28)
///   L_colour   = mean over rays of |c - F c_gt|^2                                 (6.23)
///   L_mask     = mean over rays of (sum of w - F)^2                               (6.29)
///   L_variance = mean over rays of Var^2                                          (6.30)
///
/// F is the mask, c_gt the image, c is composited on black. Var is that of RenderedRays: with weights w, not alpha as
/// printed in 6.31, which would count what stands hidden behind an opaque surface.
/// Letters: R rays.

#include <torch/torch.h>

#include "doppel/layers/volume_rendering/volume_rendering.h"

namespace doppel {

struct RadianceLossOptions {
  double variance_weight = 0.01;  ///< lambda; 0.1 from the second round on
  /// The variance in square metres instead of squares of the interval. In metres it is below 2.5e-3 on 10 cm, its
  /// square too small to count beside the colours.
  bool variance_in_metres = false;
};

struct RadianceLoss {
  torch::Tensor colour, mask, variance;  ///< scalars >= 0, unweighted
  torch::Tensor total;                   ///< 6.28
};

/// @param rays of render_volume with 3 colour channels
/// @param samples they were rendered from
/// @param image [R,3] RGB 0..1 @param mask [R] 0..1, may be soft
/// Gradients: to `rays`. Without rays everything is 0.
/// @throws UsageError naming the argument, with the shape found
RadianceLoss radiance_loss(const RenderedRays& rays, const RaySamples& samples, const torch::Tensor& image,
                           const torch::Tensor& mask, const RadianceLossOptions& options = {});

}  // namespace doppel
