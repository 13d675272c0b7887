#pragma once

/// What the three losses between images share: checks, masks, and one fused pass over the pixels.

#include <torch/types.h>

#include <cstdint>
#include <vector>

namespace doppel::image_loss {

/// How a pixel's difference of colour d = r - t becomes its part of a loss.
enum class Measure : int {
  chroma = 0,    ///< half the square of the chroma of 255 d, smoothed; two channels
  squares = 1,   ///< half the square of 255 d; three channels
  absolute = 2,  ///< |255 d|; three channels
};

/// Pixels that take part, and by how many the sum is divided.
struct PixelMask {
  torch::Tensor weight;    ///< uint8 [B,C,H,W], 0 or 1
  std::int64_t count = 0;  ///< of the whole batch, at least 1
};

/// U' and V' without their constants, which a difference does not have: rows for U and V, columns for R, G, B.
constexpr double kChroma[2][3] = {{-0.14714119 / 0.87202066, -0.28886916 / 0.87202066, 0.43601035 / 0.87202066},
                                  {0.61497538 / 1.22995076, -0.51496512 / 1.22995076, -0.10001026 / 1.22995076}};

/// @throws UsageError naming `op` unless shapes and types fit (chroma.h)
void check_images(const char* op, const torch::Tensor& rendered, const torch::Tensor& covered,
                  const torch::Tensor& target, const torch::Tensor& target_mask);

/// One side of a Gaussian's taps, the middle one first: [half_size + 1], of sum 1 over the window. One tap without
/// smoothing.
std::vector<double> gaussian_taps(double sigma, int half_size);

/// uint8 [..], 0 or 1, of a bool or uint8 mask.
torch::Tensor binary(const torch::Tensor& mask);
/// Non-zero pixels, at least 1.
std::int64_t count_pixels(const torch::Tensor& mask);

/// sum over pixels and channels / (count * channels), in plain tensor operations (squares and absolute only).
torch::Tensor masked_reference(const torch::Tensor& rendered, const torch::Tensor& target, const PixelMask& mask,
                               Measure measure);
/// The same, fused, for float32 on the CPU, with gradients to both images; taps only for chroma.
torch::Tensor fused(const torch::Tensor& rendered, const torch::Tensor& target, const PixelMask& mask, Measure measure,
                    const std::vector<double>& taps = {1.0});

}  // namespace doppel::image_loss
