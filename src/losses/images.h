#pragma once

#include <torch/types.h>

namespace doppel {

/// Converts 8-bit colours [...,3] to float32 0..1.
/// @throws UsageError for another type
torch::Tensor image_float(const torch::Tensor& image);

/// Values of an image at pixels. @param image [H,W,...] @param pixels int64 [R,2] column, row @return [R,...]
torch::Tensor at_pixels(const torch::Tensor& image, const torch::Tensor& pixels);

/// Erodes masks `times` times with a 3x3 square. Pixels beyond the image count as foreground: a mask that the image
/// border cuts off is not eroded there.
/// @param mask bool or uint8 [B,C,H,W], non-zero = foreground
/// @return uint8 [B,C,H,W], 0 or 1
/// @throws UsageError for another type or shape, or times < 0
torch::Tensor erode_mask(const torch::Tensor& mask, int times);
/// The same in plain tensor operations.
torch::Tensor erode_mask_reference(const torch::Tensor& mask, int times);

}  // namespace doppel
