#include "doppel/losses/chroma.h"

#include <algorithm>

#include "doppel/core/error.h"
#include "doppel/core/tensor/reference_scope.h"
#include "doppel/losses/image_terms.h"

namespace doppel {

using torch::Tensor;

namespace {

void check(const Tensor& rendered, const Tensor& covered, const Tensor& target, const Tensor& target_mask,
           const ChromaOptions& options) {
  image_loss::check_images("chroma_loss", rendered, covered, target, target_mask);
  if (!(options.smoothing >= 0.0) || options.half_size < 1 || options.half_size > 8)
    fail<UsageError>(
        "chroma_loss: smoothing {} with half size {}; the first must be at least 0 (0: none), the "
        "second 1 to 8",
        options.smoothing, options.half_size);
}

/// The foreground mask. The count is the number of pixels in mask or drawing, without views that show no foreground.
image_loss::PixelMask chroma_mask(const Tensor& covered, const Tensor& target_mask) {
  image_loss::PixelMask mask;
  mask.weight = image_loss::binary(target_mask);
  const Tensor seen = mask.weight.flatten(2).any(2).unsqueeze(-1).unsqueeze(-1);
  mask.count = image_loss::count_pixels((covered.ne(0) | target_mask.ne(0)) & seen);
  return mask;
}

/// Smooths [B,C,H,W,3] with zeros beyond the image.
Tensor smooth(const Tensor& image, const std::vector<double>& taps) {
  const auto half = static_cast<std::int64_t>(taps.size()) - 1;
  if (half == 0) return image;
  std::vector<double> window;
  for (std::int64_t i = -half; i <= half; ++i) window.push_back(taps[std::abs(i)]);
  const Tensor line = torch::tensor(window, torch::kFloat64).to(image.options().requires_grad(false));
  const Tensor planes = image.permute({0, 1, 4, 2, 3}).reshape({-1, 1, image.size(2), image.size(3)});
  const Tensor down = torch::conv2d(planes, line.view({1, 1, -1, 1}), {}, 1, torch::IntArrayRef{half, 0});
  const Tensor across = torch::conv2d(down, line.view({1, 1, 1, -1}), {}, 1, torch::IntArrayRef{0, half});
  return across.view({image.size(0), image.size(1), 3, image.size(2), image.size(3)}).permute({0, 1, 3, 4, 2});
}

/// U' and V', 0..255, of the foreground on black.
Tensor chroma(const Tensor& image, const Tensor& foreground, const std::vector<double>& taps) {
  const Tensor masked = torch::where(foreground, image, torch::zeros({}, image.options()));
  const Tensor c =
      torch::tensor({{-0.14714119, -0.28886916, 0.43601035}, {0.61497538, -0.51496512, -0.10001026}}, torch::kFloat64);
  const Tensor range = torch::tensor({{0.43601035}, {0.61497538}}, torch::kFloat64);
  const Tensor matrix = (0.5 * c / range).to(image.options().requires_grad(false));
  return 255.0 * (torch::matmul(smooth(masked, taps), matrix.t()) + 0.5);
}

}  // namespace

std::int64_t chroma_pixels(const Tensor& covered, const Tensor& target_mask) {
  return chroma_mask(covered, target_mask).count;
}

Tensor chroma_loss_reference(const Tensor& rendered, const Tensor& covered, const Tensor& target,
                             const Tensor& target_mask, const ChromaOptions& options) {
  check(rendered, covered, target, target_mask, options);
  if (rendered.numel() == 0) return (rendered.sum() + target.sum()) * 0.0;
  const auto taps = image_loss::gaussian_taps(options.smoothing, options.half_size);
  const image_loss::PixelMask mask = chroma_mask(covered, target_mask);
  const Tensor foreground = mask.weight.ne(0).unsqueeze(-1);
  const Tensor difference = chroma(rendered, foreground, taps) - chroma(target, foreground, taps);
  return 0.5 * difference.square().sum() / (2.0 * static_cast<double>(std::max<std::int64_t>(mask.count, 1)));
}

Tensor chroma_loss(const Tensor& rendered, const Tensor& covered, const Tensor& target, const Tensor& target_mask,
                   const ChromaOptions& options) {
  check(rendered, covered, target, target_mask, options);
  if (!takes_kernel(rendered)) return chroma_loss_reference(rendered, covered, target, target_mask, options);
  return image_loss::fused(rendered, target, chroma_mask(covered, target_mask), image_loss::Measure::chroma,
                           image_loss::gaussian_taps(options.smoothing, options.half_size));
}

}  // namespace doppel
