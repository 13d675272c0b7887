#pragma once

/// Photometric loss: differences of colour, for a texture.
///
///   L = sum over views, pixels of M, {R,G,B} of d(255 (r - t)) / (3 |M|),   M = erode(mask) and drawing
///
/// d(x) = |x|, or x^2 / 2 with `squares`. The former is minimal at the median of a texel's observed colours, the latter
/// at their mean. The erosion keeps background out of the texture where the drawing extends beyond the person.
/// Equation: 6.18

#include <torch/types.h>

namespace doppel {

struct PhotometricOptions {
  int erosion = 2;       ///< pixels by which the mask is eroded
  bool squares = false;  ///< half the squares of the differences instead of their absolute values
};

/// @param rendered float [B,C,H,W,3], RGB 0..1
/// @param covered bool or uint8 [B,C,H,W]: where something is drawn
/// @param target the type of `rendered` [B,C,H,W,3]
/// @param target_mask bool or uint8 [B,C,H,W]: foreground
/// @return scalar >= 0; 0 when no pixel counts
/// Gradients: to `rendered` and `target`; the subgradient of |x| at 0 is 0. No second derivative. Kernel and
/// reference as in chroma.h.
/// @throws UsageError with what was found
torch::Tensor photometric_loss(const torch::Tensor& rendered, const torch::Tensor& covered, const torch::Tensor& target,
                               const torch::Tensor& target_mask, const PhotometricOptions& options = {});
/// The number of pixels |M| that the loss is a mean over.
std::int64_t photometric_pixels(const torch::Tensor& covered, const torch::Tensor& target_mask,
                                const PhotometricOptions& options = {});
/// The loss in plain tensor operations.
torch::Tensor photometric_loss_reference(const torch::Tensor& rendered, const torch::Tensor& covered,
                                         const torch::Tensor& target, const torch::Tensor& target_mask,
                                         const PhotometricOptions& options = {});

}  // namespace doppel
