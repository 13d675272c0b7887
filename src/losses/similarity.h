#pragma once

/// Structural similarity (Wang et al. 2004) as a loss: 1 - SSIM, window and constants as in `structural_similarity` of
/// the evaluation, windows that the image's border cuts off left out.

#include <torch/types.h>

namespace doppel {

/// Plain tensor operations. @param a, b [B,C,H,W,3] RGB 0..1, at least 11 x 11 pixels
/// @return scalar 0..2, the mean over windows and channels, with gradients to both
/// @throws UsageError for another shape
torch::Tensor similarity_loss(const torch::Tensor& a, const torch::Tensor& b);

}  // namespace doppel
