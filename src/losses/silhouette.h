#pragma once

#include <torch/types.h>

#include "doppel/losses/silhouette_types.h"
#include "doppel/render/outline.h"

namespace doppel {

/// Two-sided silhouette loss: boundary vertices are drawn to the outline of the mask, and each contour pixel draws the
/// nearest boundary vertex. Summed over vertices (contour pixels), mean over valid cameras of the batch; 0 without any.
///
/// Gradient: to `vertices` only; not through boundary set, normals, rho. Where rho is -1 (vertex inside the mask whose
/// normal looks away from the nearest outline) the sign of the *gradient* is turned, the value is not.
/// @param vertices float32 or float64 [B,N,3], world, metres
/// @param faces int32 or int64 [F,3]
/// float32 on the CPU takes the fused kernel (value and gradient in one pass), everything else, and a ReferenceScope,
/// the reference.
/// @throws Error for wrong shapes or types
/// Equation: 6.8
SilhouetteLoss silhouette_loss(const torch::Tensor& vertices, const torch::Tensor& faces,
                               const SilhouetteTarget& target, const SilhouetteOptions& options = {});

/// The same for a boundary set given by the caller, bool [B,C,N] (boundary_vertices).
SilhouetteLoss silhouette_loss(const torch::Tensor& vertices, const torch::Tensor& faces, const torch::Tensor& boundary,
                               const SilhouetteTarget& target, const SilhouetteOptions& options = {});

/// The same for the points of an outline, drawn at the size of the distance images: both sums run over them instead of
/// boundary vertices, and their gradients go to the corners of the faces that are seen there.
SilhouetteLoss silhouette_loss(const torch::Tensor& vertices, const torch::Tensor& faces, const OutlinePoints& outline,
                               const SilhouetteTarget& target, const SilhouetteOptions& options = {});

/// Area-weighted vertex normals of unit length [B,N,3]; zero for a vertex without area. No gradient. float32 or
/// float64.
torch::Tensor silhouette_normals(const torch::Tensor& vertices, const torch::Tensor& faces);

}  // namespace doppel
