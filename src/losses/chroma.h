#pragma once

/// Chroma loss: compares a drawn and a filmed image in U and V only, so that shadows that the renderer does not model
/// have little influence.
///
///   L = 1/2 sum over views, pixels, {U,V} of (255 (g(m r) - g(m t)))^2 / n
///
/// with r the drawn image, t the filmed image, m the foreground mask, g the chroma of the (smoothed) image and n twice
/// the number of pixels in mask or drawing. g maps RGB to U and V, and these to 0..1 (method of BT.601):
///   U = -.14714119 R - .28886916 G + .43601035 B,  U' = U / (2 * .43601035) + 1/2
///   V =  .61497538 R - .51496512 G - .10001026 B,  V' = V / (2 * .61497538) + 1/2
/// Equation: 6.16

#include <torch/types.h>

namespace doppel {

struct ChromaOptions {
  double smoothing = 1.0;  ///< standard deviation of the Gaussian on both images, pixels; 0: none
  int half_size = 1;       ///< half the size of the Gaussian's window, pixels, 1 to 8
};

/// @param rendered float [B,C,H,W,3], RGB 0..1, 0 where nothing is drawn
/// @param covered bool or uint8 [B,C,H,W]: where something is drawn
/// @param target the type of `rendered` [B,C,H,W,3]; may require gradients, as the result of `target_on_surface` does
/// @param target_mask bool or uint8 [B,C,H,W]: foreground. A view without foreground is left out
/// @return scalar >= 0; 0 when no pixel counts
/// Gradients: to `rendered` and `target`, within the mask; n is a constant. No second derivative.
/// float32 on the CPU runs the fused kernel; everything else, and a ReferenceScope, runs the reference.
/// @throws UsageError with what was found
torch::Tensor chroma_loss(const torch::Tensor& rendered, const torch::Tensor& covered, const torch::Tensor& target,
                          const torch::Tensor& target_mask, const ChromaOptions& options = {});

/// The number of pixels that the loss is a mean over.
std::int64_t chroma_pixels(const torch::Tensor& covered, const torch::Tensor& target_mask);

/// The loss in plain tensor operations: any device and float type.
torch::Tensor chroma_loss_reference(const torch::Tensor& rendered, const torch::Tensor& covered,
                                    const torch::Tensor& target, const torch::Tensor& target_mask,
                                    const ChromaOptions& options = {});

}  // namespace doppel
