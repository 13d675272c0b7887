#include "doppel/losses/radiance.h"

#include <algorithm>

#include "doppel/core/tensor/checks.h"

namespace doppel {

using torch::Tensor;

RadianceLoss radiance_loss(const RenderedRays& rays, const RaySamples& samples, const Tensor& image, const Tensor& mask,
                           const RadianceLossOptions& options) {
  constexpr const char* kName = "radiance_loss";
  check_shape(kName, "rays.colour", rays.colour, {-1, 3}, "[R,3]");
  const int64_t R = rays.colour.size(0);
  check_shape(kName, "image", image, {R, 3}, "[R,3]");
  check_shape(kName, "mask", mask, {R}, "[R]");
  check_same_kind(kName, "image", image, rays.colour);
  check_same_kind(kName, "mask", mask, rays.colour);
  const auto mean = [&](const Tensor& per_ray) { return per_ray.sum() / static_cast<double>(std::max<int64_t>(R, 1)); };
  RadianceLoss loss;
  loss.rays = R;
  loss.colour = mean((rays.colour - mask.unsqueeze(1) * image).square().sum(1));
  loss.mask = mean((rays.opacity - mask).square());
  const Tensor variance =
      options.variance_in_metres ? rays.variance * (samples.far - samples.near).square() : rays.variance;
  loss.variance = mean(variance.square());
  loss.total = loss.colour + loss.mask + options.variance_weight * loss.variance;
  return loss;
}

}  // namespace doppel
