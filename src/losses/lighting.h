#pragma once

/// Lighting loss: squared differences of colour where both images reliably show the person.
///
///   L = 1/2 sum over views, pixels of M, {R,G,B} of (255 (r - t))^2 / (3 |M|),   M = erode(mask and drawing)
///
/// Outside M one of the images shows background, which would bias the lighting towards black.
/// Equation: 6.13

#include <torch/types.h>

namespace doppel {

struct LightingLossOptions {
  int erosion = 1;  ///< pixels by which the overlap of mask and drawing is eroded
};

/// @param rendered float [B,C,H,W,3], RGB 0..1
/// @param covered bool or uint8 [B,C,H,W]: where something is drawn
/// @param target the type of `rendered` [B,C,H,W,3]
/// @param target_mask bool or uint8 [B,C,H,W]: foreground
/// @return scalar >= 0; 0 when no pixel counts
/// Gradients: to `rendered` and `target`. No second derivative. Kernel and reference as in chroma.h.
/// @throws UsageError with what was found
torch::Tensor lighting_loss(const torch::Tensor& rendered, const torch::Tensor& covered, const torch::Tensor& target,
                            const torch::Tensor& target_mask, const LightingLossOptions& options = {});
/// The number of pixels |M| that the loss is a mean over.
std::int64_t lighting_pixels(const torch::Tensor& covered, const torch::Tensor& target_mask,
                             const LightingLossOptions& options = {});
/// The loss in plain tensor operations.
torch::Tensor lighting_loss_reference(const torch::Tensor& rendered, const torch::Tensor& covered,
                                      const torch::Tensor& target, const torch::Tensor& target_mask,
                                      const LightingLossOptions& options = {});

}  // namespace doppel
