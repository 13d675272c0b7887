#include "doppel/losses/lighting.h"

#include "doppel/core/tensor/reference_scope.h"
#include "doppel/losses/image_terms.h"
#include "doppel/losses/images.h"

namespace doppel {

using torch::Tensor;

namespace {

using Erode = Tensor (*)(const Tensor&, int);

image_loss::PixelMask lighting_mask(const Tensor& covered, const Tensor& target_mask,
                                    const LightingLossOptions& options, Erode erode) {
  image_loss::PixelMask mask;
  mask.weight = erode(covered.ne(0) & target_mask.ne(0), options.erosion);
  mask.count = image_loss::count_pixels(mask.weight);
  return mask;
}

}  // namespace

std::int64_t lighting_pixels(const Tensor& covered, const Tensor& target_mask, const LightingLossOptions& options) {
  return lighting_mask(covered, target_mask, options, erode_mask).count;
}

Tensor lighting_loss_reference(const Tensor& rendered, const Tensor& covered, const Tensor& target,
                               const Tensor& target_mask, const LightingLossOptions& options) {
  image_loss::check_images("lighting_loss", rendered, covered, target, target_mask);
  return image_loss::masked_reference(rendered, target,
                                      lighting_mask(covered, target_mask, options, erode_mask_reference),
                                      image_loss::Measure::squares);
}

Tensor lighting_loss(const Tensor& rendered, const Tensor& covered, const Tensor& target, const Tensor& target_mask,
                     const LightingLossOptions& options) {
  image_loss::check_images("lighting_loss", rendered, covered, target, target_mask);
  if (!takes_kernel(rendered)) return lighting_loss_reference(rendered, covered, target, target_mask, options);
  return image_loss::fused(rendered, target, lighting_mask(covered, target_mask, options, erode_mask),
                           image_loss::Measure::squares);
}

}  // namespace doppel
