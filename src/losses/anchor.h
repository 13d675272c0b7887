#pragma once

/// Anchor loss: vertices stay at their positions on another surface where the images do not move them. Not in the
/// thesis.
///
///   L = mean over batch and vertices of |V_i - W_i|^2
///
/// Square metres. Letters: B batch, N vertices.

#include <torch/types.h>

namespace doppel {

/// @param vertices [B,N,3] any float type @param anchors [B,N,3] W, of the same type
/// @return scalar >= 0. Gradient: to both arguments
torch::Tensor anchor_loss(const torch::Tensor& vertices, const torch::Tensor& anchors);

}  // namespace doppel
