#pragma once

#include "doppel/losses/silhouette.h"

/// The two ways to compute the silhouette loss; arguments already checked, see silhouette_loss.
namespace doppel::silhouette {

SilhouetteLoss reference(const torch::Tensor& vertices, const torch::Tensor& faces, const torch::Tensor& boundary,
                         const SilhouetteTarget& target, const SilhouetteOptions& options);

SilhouetteLoss fused(const torch::Tensor& vertices, const torch::Tensor& faces, const torch::Tensor& boundary,
                     const SilhouetteTarget& target, const SilhouetteOptions& options);

/// A vertex takes part in the model-to-data sum when it lies this far inside the crop, pixels.
constexpr double kInset = 2;

/// 1 / (crop pixels that make a residual of 1), [B,C], in the chosen unit.
torch::Tensor residual_scale(const SilhouetteTarget& target, const SilhouetteOptions& options, torch::ScalarType dtype);

}  // namespace doppel::silhouette
