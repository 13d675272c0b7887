#pragma once

/// A layer of a trained network for images: convolution, normalisation by fixed statistics and activation in one pass.
///
///   y = a(scale * (w (*) u(x)) + shift),   a(v) = v for v > 0, otherwise slope * v
///
/// (*) is a convolution with padding 1, and u enlarges the image twofold (bilinear) or leaves it as it is. Shapes: B
/// batch, C channels, H, W pixels. No gradients: training uses LibTorch's layers. float32 on the CPU runs the kernel,
/// everything else the reference.

#include <torch/types.h>

namespace doppel {

struct ImageConvolution {
  torch::Tensor weight{};  ///< [Cout,Cin,3,3], stride 1; or [Cout,Cin,4,4], stride 2
  torch::Tensor scale{};   ///< [Cout]; undefined: 1
  torch::Tensor shift{};   ///< [Cout]; undefined: 0
  double slope = 1.0;      ///< of negative values: 1 keeps them, 0 is a ReLU
  bool enlarge = false;    ///< enlarges the image first; with 3x3 weights only
};

/// @param image  [B,C1,H,W]; may be expanded: pixels that share memory are read once
/// @param second [B,C2,H,W], the channels after those of `image`, C1 + C2 = Cin; undefined: none
/// @return [B,Cout,H',W']: 3x3 the size of u(x); 4x4 half of H and W, which must be even
/// @throws UsageError naming the argument and the shape received
torch::Tensor image_convolution(const torch::Tensor& image, const torch::Tensor& second, const ImageConvolution& layer);

/// The definition, in plain tensor operations of any dtype.
torch::Tensor image_convolution_reference(const torch::Tensor& image, const torch::Tensor& second,
                                          const ImageConvolution& layer);

}  // namespace doppel
