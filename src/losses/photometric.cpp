#include "doppel/losses/photometric.h"

#include "doppel/core/tensor/reference_scope.h"
#include "doppel/losses/image_terms.h"
#include "doppel/losses/images.h"

namespace doppel {

using torch::Tensor;

namespace {

using Erode = Tensor (*)(const Tensor&, int);

image_loss::PixelMask photometric_mask(const Tensor& covered, const Tensor& target_mask,
                                       const PhotometricOptions& options, Erode erode) {
  image_loss::PixelMask mask;
  mask.weight = erode(target_mask, options.erosion).bitwise_and_(image_loss::binary(covered));
  mask.count = image_loss::count_pixels(mask.weight);
  return mask;
}

image_loss::Measure photometric_measure(const PhotometricOptions& options) {
  return options.squares ? image_loss::Measure::squares : image_loss::Measure::absolute;
}

}  // namespace

std::int64_t photometric_pixels(const Tensor& covered, const Tensor& target_mask, const PhotometricOptions& options) {
  return photometric_mask(covered, target_mask, options, erode_mask).count;
}

Tensor photometric_loss_reference(const Tensor& rendered, const Tensor& covered, const Tensor& target,
                                  const Tensor& target_mask, const PhotometricOptions& options) {
  image_loss::check_images("photometric_loss", rendered, covered, target, target_mask);
  return image_loss::masked_reference(rendered, target,
                                      photometric_mask(covered, target_mask, options, erode_mask_reference),
                                      photometric_measure(options));
}

Tensor photometric_loss(const Tensor& rendered, const Tensor& covered, const Tensor& target, const Tensor& target_mask,
                        const PhotometricOptions& options) {
  image_loss::check_images("photometric_loss", rendered, covered, target, target_mask);
  if (!takes_kernel(rendered)) return photometric_loss_reference(rendered, covered, target, target_mask, options);
  return image_loss::fused(rendered, target, photometric_mask(covered, target_mask, options, erode_mask),
                           photometric_measure(options));
}

}  // namespace doppel
