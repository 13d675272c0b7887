#include <torch/types.h>

#include "doppel/losses/silhouette_terms.h"

/// The silhouette loss in plain tensor operations, the reference of the fused kernel.
namespace doppel::silhouette {
namespace {

using torch::Tensor;
using torch::indexing::Ellipsis;
using torch::indexing::Slice;

/// Points in homogeneous pixels, [B,C,N,3].
Tensor homogeneous_pixels(const Tensor& points, const Tensor& projection) {
  const Tensor linear = projection.index({Ellipsis, Slice(0, 3)}), offset = projection.index({Ellipsis, 3});
  return torch::matmul(points.unsqueeze(1), linear.transpose(2, 3)) + offset.unsqueeze(2);
}

Tensor component(const Tensor& t, std::int64_t i) { return t.index({Ellipsis, i}); }

/// A distance field interpolated between pixel centres, with the gradient of the interpolation.
struct Sample {
  Tensor distance;  ///< [B,C,N], differentiable in the pixels
  Tensor du, dv;    ///< [B,C,N]
};

/// @param pixels [B,C,N,2] inside the image by at least half a pixel
Sample sample(const Tensor& image, const Tensor& pixels) {
  const std::int64_t size = image.size(3);
  const Tensor x = component(pixels, 0) - 0.5, y = component(pixels, 1) - 0.5;
  const Tensor x0 = x.detach().floor().clamp(0, size - 2), y0 = y.detach().floor().clamp(0, size - 2);
  const Tensor index = (y0 * size + x0).to(torch::kInt64), flat = image.flatten(2);
  const auto corner = [&](std::int64_t dx, std::int64_t dy) { return flat.gather(2, index + (dy * size + dx)); };
  const Tensor d00 = corner(0, 0), d10 = corner(1, 0), d01 = corner(0, 1), d11 = corner(1, 1);
  const Tensor fx = x - x0, fy = y - y0;
  const Tensor top = d00 + fx * (d10 - d00), bottom = d01 + fx * (d11 - d01);
  const Tensor fx_held = fx.detach(), fy_held = fy.detach();
  return {top + fy * (bottom - top), (1 - fy_held) * (d10 - d00) + fy_held * (d11 - d01),
          (1 - fx_held) * (d01 - d00) + fx_held * (d11 - d10)};
}

/// -1 where a vertex inside the mask faces away from the nearest outline, else 1, [B,C,N]. Equation: 5.11, 4.5.2
Tensor rho(const Sample& at, const Tensor& h, const Tensor& normals, const Tensor& projection) {
  const Tensor dh = torch::matmul(normals.unsqueeze(1), projection.index({Ellipsis, Slice(0, 3)}).transpose(2, 3));
  const Tensor w = component(h, 2);
  const Tensor nu = (component(dh, 0) - component(h, 0) / w * component(dh, 2)) / w;
  const Tensor nv = (component(dh, 1) - component(h, 1) / w * component(dh, 2)) / w;
  // Inside, |d| = -d, so the direction to the outline, -grad |d|, is grad d.
  const Tensor away = (nu * at.du + nv * at.dv < 0) & (at.distance < 0);
  return 1 - 2 * away.to(h.dtype());
}

/// The value of `x`, and its gradient times `sign`.
Tensor with_gradient_times(const Tensor& sign, const Tensor& x) { return sign * x + (1 - sign) * x.detach(); }

/// First sum of 6.8 for every vertex, [B,C,N].
Tensor model_to_data(const Tensor& h, const Tensor& normals, const Tensor& use, const Tensor& projection,
                     const Tensor& distance, double inset, const Tensor& scale) {
  const double size = static_cast<double>(distance.size(3));
  const Tensor w = component(h, 2);
  const Tensor u = component(h, 0) / w, v = component(h, 1) / w;
  const Tensor inside = use & (w > 0) & (u >= kInset) & (v >= kInset) & (u <= size - kInset) & (v <= size - kInset);
  // Excluded vertices are moved to a harmless position before sampling, so that no NaN reaches their gradient.
  const Tensor safe_h = torch::where(inside.unsqueeze(3), h, torch::tensor({size / 2, size / 2, 1.0}, h.options()));
  const Tensor pixels = safe_h.index({Ellipsis, Slice(0, 2)}) / safe_h.index({Ellipsis, Slice(2, 3)});
  Sample at = sample(distance, pixels);
  at.distance = at.distance + inset;
  const Tensor residual = at.distance * scale.unsqueeze(2);
  const Tensor sign = rho(at, safe_h.detach(), normals, projection).detach();
  return torch::where(inside, with_gradient_times(sign, residual.square()), torch::zeros_like(residual));
}

/// Second sum of 6.8 for one camera. @param pixels [N,2]; @param use bool [N]; @param contour [P,2]; @param scale []
Tensor data_to_model(const Tensor& pixels, const Tensor& use, const Tensor& contour, double radius,
                     const Tensor& scale) {
  const Tensor candidates = pixels.index({use});
  if (candidates.size(0) == 0 || contour.size(0) == 0) return pixels.new_zeros({});
  const Tensor squared = (contour.unsqueeze(1) - candidates.detach().unsqueeze(0)).square().sum(2);
  const auto [nearest, index] = squared.min(1);
  const Tensor residual = (candidates.index_select(0, index) - contour) * scale;
  return (residual.square().sum(1) * (nearest <= radius * radius)).sum();
}

}  // namespace

SilhouetteLoss reference(const Tensor& vertices, const Tensor& normals, const Tensor& boundary,
                         const SilhouetteTarget& target, const ResidualScales& scales,
                         const SilhouetteOptions& options) {
  const auto dtype = vertices.scalar_type();
  const Tensor projection = target.projection.to(dtype), distance = target.distance.to(dtype);
  const Tensor h = homogeneous_pixels(vertices, projection);
  const Tensor use = boundary & target.valid.unsqueeze(2);
  const double weight = 1 / std::max(target.valid.sum().item<double>(), 1.0);
  const Tensor zero = (vertices * 0).sum();
  SilhouetteLoss loss{zero, zero};
  if (options.model_to_data != 0 && distance.size(3) > 2 * kInset) {
    const Tensor scale = scales.model_to_data.to(dtype);
    loss.model_to_data = model_to_data(h, normals, use, projection, distance, options.inset, scale).sum() *
                         (weight * options.model_to_data);
  }
  if (options.data_to_model != 0) {
    const Tensor pixels = h.index({Ellipsis, Slice(0, 2)}) / h.index({Ellipsis, Slice(2, 3)});
    const std::int64_t cameras = projection.size(1);
    const Tensor scale = scales.data_to_model.to(dtype);
    const Tensor contour = target.contour.to(dtype), front = use & (component(h, 2) > 0);
    std::vector<Tensor> sums{zero};
    for (std::int64_t i = 0; i < vertices.size(0) * cameras; ++i) {
      const std::int64_t first = target.contour_offsets[i].item<std::int64_t>(),
                         last = target.contour_offsets[i + 1].item<std::int64_t>();
      sums.push_back(data_to_model(pixels[i / cameras][i % cameras], front[i / cameras][i % cameras],
                                   contour.slice(0, first, last), options.contour_radius,
                                   scale[i / cameras][i % cameras]));
    }
    loss.data_to_model = torch::stack(sums).sum() * (weight * options.data_to_model);
  }
  return loss;
}

}  // namespace doppel::silhouette
