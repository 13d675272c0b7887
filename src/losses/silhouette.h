#pragma once

#include <torch/types.h>

#include "doppel/losses/silhouette_types.h"
#include "doppel/render/outline/outline.h"

namespace doppel {

/// Two-sided silhouette loss: boundary vertices are drawn to the outline of the mask, and each contour pixel draws the
/// nearest boundary vertex. Sum over vertices and over contour pixels, mean over the valid cameras of the batch; 0
/// without valid cameras.
///
/// Gradient: to `vertices` only; not through the boundary set, the normals or rho. Where rho is -1 (a vertex inside the
/// mask whose normal points away from the nearest outline), the *gradient* is negated, the value is not.
/// @param vertices float32 or float64 [B,N,3], world, metres
/// @param faces int32 or int64 [F,3]
/// float32 on the CPU runs the fused kernel (value and gradient in one pass); everything else, and a ReferenceScope,
/// runs the reference.
/// @throws Error for wrong shapes or types
/// Equation: 6.8
SilhouetteLoss silhouette_loss(const torch::Tensor& vertices, const torch::Tensor& faces,
                               const SilhouetteTarget& target, const SilhouetteOptions& options = {});

/// As above, for a given boundary set, bool [B,C,N] (boundary_vertices).
SilhouetteLoss silhouette_loss(const torch::Tensor& vertices, const torch::Tensor& faces, const torch::Tensor& boundary,
                               const SilhouetteTarget& target, const SilhouetteOptions& options = {});

/// As above, for the points of an outline drawn at the size of the distance fields. Both sums run over these points
/// instead of boundary vertices, and the gradients go to the corners of the faces at the points.
SilhouetteLoss silhouette_loss(const torch::Tensor& vertices, const torch::Tensor& faces, const OutlinePoints& outline,
                               const SilhouetteTarget& target, const SilhouetteOptions& options = {});

/// Area-weighted vertex normals of unit length [B,N,3]; zero for a vertex without area. No gradient. float32 or
/// float64.
torch::Tensor silhouette_normals(const torch::Tensor& vertices, const torch::Tensor& faces);

}  // namespace doppel
