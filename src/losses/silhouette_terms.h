#pragma once

#include "doppel/losses/silhouette_types.h"

namespace doppel::silhouette {

/// Residual per crop pixel in each view, both [B,C].
struct ResidualScales {
  torch::Tensor model_to_data, data_to_model;
};

/// Reference and kernel of silhouette_loss, with checked arguments. `normals` [B,N,3].
SilhouetteLoss reference(const torch::Tensor& vertices, const torch::Tensor& normals, const torch::Tensor& boundary,
                         const SilhouetteTarget& target, const ResidualScales& scales,
                         const SilhouetteOptions& options);

SilhouetteLoss fused(const torch::Tensor& vertices, const torch::Tensor& normals, const torch::Tensor& boundary,
                     const SilhouetteTarget& target, const ResidualScales& scales, const SilhouetteOptions& options);

/// A vertex counts in the model-to-data sum if its distance from the crop's border is at least this, pixels.
constexpr double kInset = 2;

}  // namespace doppel::silhouette
