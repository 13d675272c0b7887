#pragma once

#include <torch/types.h>

namespace doppel {

/// The drawing of a person and the filmed image, where a loss compares them. Plain tensor operations, differentiable.
struct PersonImages {
  torch::Tensor drawn, filmed;  ///< [B,C,H,W,3] RGB, black where they are not compared
  /// [B,C,H,W] 1 where a pixel is all person or all background, so that alpha must be the mask; else 0
  torch::Tensor certain;
};

/// The drawing over black and the person cut out. @param colour [B,C,H,W,3] over black, 0..1
/// @param image [B,C,H,W,3] RGB 0..1 @param mask [B,C,H,W] of the type of the images, 0 or 1
PersonImages person_over_black(const torch::Tensor& colour, const torch::Tensor& image, const torch::Tensor& mask);

/// The drawing over the empty studio and the image as filmed, up to two pixels beyond the mask. A pixel of the outline
/// mixes the colours of person and studio, in the image and in this drawing; over black, the drawing would have to take
/// the studio's colour. There, within a pixel of the outline, nothing is certain.
/// @param alpha [B,C,H,W] 0..1 of the drawing @param studio [B,C,H,W,3] RGB 0..1
PersonImages person_over_studio(const torch::Tensor& colour, const torch::Tensor& alpha, const torch::Tensor& image,
                                const torch::Tensor& mask, const torch::Tensor& studio);

}  // namespace doppel
