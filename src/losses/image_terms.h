#pragma once

/// Shared parts of the three losses between images: checks, masks, and one fused pass over the pixels.

#include <torch/types.h>

#include <cstdint>
#include <vector>

namespace doppel::image_loss {

/// The contribution of a pixel to a loss, as a function of its colour difference d = r - t.
enum class Measure : int {
  chroma = 0,    ///< half the square of the chroma of 255 d, smoothed; two channels
  squares = 1,   ///< half the square of 255 d; three channels
  absolute = 2,  ///< |255 d|; three channels
};

/// The pixels that count, and the divisor of the sum.
struct PixelMask {
  torch::Tensor weight;    ///< uint8 [B,C,H,W], 0 or 1
  std::int64_t count = 0;  ///< of the whole batch; 0 where nothing counts, and the sum is 0 then
};

/// U' and V' without their constants, which cancel in a difference: rows for U and V, columns for R, G, B.
constexpr double kChroma[2][3] = {{-0.14714119 / 0.87202066, -0.28886916 / 0.87202066, 0.43601035 / 0.87202066},
                                  {0.61497538 / 1.22995076, -0.51496512 / 1.22995076, -0.10001026 / 1.22995076}};

/// @throws UsageError naming `op` unless shapes and types fit (chroma.h)
void check_images(const char* op, const torch::Tensor& rendered, const torch::Tensor& covered,
                  const torch::Tensor& target, const torch::Tensor& target_mask);

/// One half of the taps of a Gaussian, the middle tap first: [half_size + 1], with sum 1 over the window. A single tap
/// without smoothing.
std::vector<double> gaussian_taps(double sigma, int half_size);

/// Converts a bool or uint8 mask to uint8 [..], 0 or 1.
torch::Tensor binary(const torch::Tensor& mask);
/// The number of non-zero pixels.
std::int64_t count_pixels(const torch::Tensor& mask);

/// sum over pixels and channels / (count * channels), in plain tensor operations (squares and absolute only).
torch::Tensor masked_reference(const torch::Tensor& rendered, const torch::Tensor& target, const PixelMask& mask,
                               Measure measure);
/// The same, fused, for float32 on the CPU, with gradients to both images; taps only for chroma.
torch::Tensor fused(const torch::Tensor& rendered, const torch::Tensor& target, const PixelMask& mask, Measure measure,
                    const std::vector<double>& taps = {1.0});

}  // namespace doppel::image_loss
