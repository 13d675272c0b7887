#include "doppel/losses/images.h"

#include <ATen/Parallel.h>

#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"
#include "doppel/core/tensor/reference_scope.h"
#include "doppel/losses/image_kernel.h"
#include "doppel/losses/image_terms.h"

namespace doppel {

using torch::Tensor;

namespace {

void check_erosion(const Tensor& mask, int times) {
  check_tensor("erode_mask", "the mask", mask, {torch::kBool, torch::kUInt8}, {-1, -1, -1, -1}, "[B,C,H,W]");
  if (times < 0) fail<UsageError>("erode_mask: the erosion is {} pixels; it must be at least 0", times);
}

}  // namespace

torch::Tensor at_pixels(const torch::Tensor& image, const torch::Tensor& pixels) {
  return image.index({pixels.select(1, 1), pixels.select(1, 0)});
}

Tensor image_float(const Tensor& image) {
  if (!image.defined() || image.scalar_type() != torch::kUInt8 || image.dim() < 1 || image.size(-1) != 3)
    fail<UsageError>("image_float: the image must be uint8 [...,3], found {}", describe(image));
  return image.to(torch::kFloat32).mul_(1.0 / 255.0);
}

Tensor erode_mask_reference(const Tensor& mask, int times) {
  check_erosion(mask, times);
  Tensor background = 1.0 - image_loss::binary(mask).to(torch::kFloat32).flatten(0, 1);
  if (background.numel() == 0) return image_loss::binary(mask);
  for (int i = 0; i < times; ++i) background = at::max_pool2d(background, {3, 3}, {1, 1}, {1, 1});
  return (1.0 - background).to(torch::kUInt8).view(mask.sizes());
}

Tensor erode_mask(const Tensor& mask, int times) {
  check_erosion(mask, times);
  Tensor result = image_loss::binary(mask).contiguous();
  if (!mask.device().is_cpu() || result.numel() == 0) return times == 0 ? result : erode_mask_reference(mask, times);
  const std::int64_t height = mask.size(2), width = mask.size(3), views = mask.size(0) * mask.size(1);
  Tensor other = times > 0 ? torch::empty_like(result) : Tensor();
  for (int i = 0; i < times; ++i) {
    const auto* from = result.data_ptr<std::uint8_t>();
    auto* to = other.data_ptr<std::uint8_t>();
    at::parallel_for(0, views * height, 256, [&](std::int64_t begin, std::int64_t end) {
      for (std::int64_t row = begin; row < end;) {
        const std::int64_t view = row / height, first = row % height;
        const std::int64_t last = std::min(height, first + end - row);
        kernels::erode_rows(from + view * height * width, height, width, first, last, to + view * height * width);
        row += last - first;
      }
    });
    std::swap(result, other);
  }
  return result;
}

}  // namespace doppel
