#include <torch/types.h>

#include "doppel/render/splats/splat_kernel.h"
#include "doppel/render/splats/splat_terms.h"
#include "doppel/render/splats/splats.h"

namespace doppel {

using torch::Tensor;

Tensor view_harmonics(const Tensor& directions, std::int64_t count) {
  const Tensor x = directions.select(-1, 0), y = directions.select(-1, 1), z = directions.select(-1, 2);
  std::vector<Tensor> all{torch::full_like(x, kFirstHarmonic)};
  if (count > 1) {
    const double c = 0.4886025119029199;
    all.insert(all.end(), {-c * y, c * z, -c * x});
  }
  if (count > 4) {
    const double c = 1.0925484305920792;
    all.insert(all.end(), {c * x * y, -c * y * z, 0.31539156525252005 * (2 * z * z - x * x - y * y), -c * x * z,
                           0.5462742152960396 * (x * x - y * y)});
  }
  if (count > 9) {
    const double a = 0.5900435899266435, b = 0.4570457994644658;
    all.insert(all.end(),
               {-a * y * (3 * x * x - y * y), 2.890611442640554 * x * y * z, -b * y * (4 * z * z - x * x - y * y),
                0.3731763325901154 * z * (2 * z * z - 3 * x * x - 3 * y * y), -b * x * (4 * z * z - x * x - y * y),
                1.445305721320277 * z * (x * x - y * y), -a * x * (x * x - 3 * y * y)});
  }
  return torch::stack(all, -1);
}

namespace splats {
namespace {

/// Rotation matrices of quaternions w x y z of any length. @param quaternions [N,4] @return [N,3,3]
Tensor rotation_matrices(const Tensor& quaternions) {
  const Tensor q = quaternions / quaternions.norm(2, 1, true);
  const Tensor w = q.select(1, 0), x = q.select(1, 1), y = q.select(1, 2), z = q.select(1, 3);
  return torch::stack({1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),  //
                       2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),  //
                       2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)},
                      1)
      .view({-1, 3, 3});
}

/// The Gaussians of one batch item.
struct Item {
  Tensor positions, rotations, log_scales, opacities, harmonics, normals;

  Item(const Splats& s, std::int64_t b)
      : positions(s.positions[b]),
        rotations(s.rotations[b]),
        log_scales(s.log_scales[b]),
        opacities(s.opacities[b]),
        harmonics(s.harmonics[b]),
        normals(s.normals.defined() ? s.normals[b] : Tensor()) {}
  Item at(const Tensor& index) const {
    Item out = *this;
    for (Tensor* t : {&out.positions, &out.rotations, &out.log_scales, &out.opacities, &out.harmonics, &out.normals})
      if (t->defined()) *t = t->index_select(0, index);
    return out;
  }
};

/// The Gaussians on the screen, nearest first.
struct Screen {
  Tensor centre;   ///< [M,2] pixels
  Tensor conic;    ///< [M,2,2] inverse of S
  Tensor opacity;  ///< [M]
  Tensor value;    ///< [M,5] colour, 1, depth
};

Screen project_item(const Item& g, const Tensor& matrix, const Tensor& camera_centre, std::int64_t height,
                    std::int64_t width) {
  const Tensor h = torch::matmul(g.positions, matrix.slice(1, 0, 3).t()) + matrix.select(1, 3);
  const Tensor depth = h.select(1, 2), centre = h.slice(1, 0, 2) / depth.unsqueeze(1);
  const Tensor size = torch::tensor({static_cast<double>(width), static_cast<double>(height)}, torch::kFloat64)
                          .to(centre.scalar_type());
  const Tensor limited =
      torch::minimum(torch::maximum(centre, -kernels::kOutsideImage * size), (1 + kernels::kOutsideImage) * size);
  const Tensor jacobian =
      (matrix.slice(0, 0, 2).slice(1, 0, 3) - limited.unsqueeze(2) * matrix[2].slice(0, 0, 3)) / depth.view({-1, 1, 1});
  const Tensor along = torch::matmul(jacobian, rotation_matrices(g.rotations) * g.log_scales.exp().unsqueeze(1));
  const Tensor covariance =
      torch::matmul(along, along.transpose(1, 2)) + kernels::kSplatBlur * torch::eye(2, centre.options());
  const Tensor offset = g.positions - camera_centre, direction = offset / offset.norm(2, 1, true);
  const Tensor basis = view_harmonics(direction, g.harmonics.size(1));
  const Tensor colour = ((basis.unsqueeze(2) * g.harmonics).sum(1) + 0.5).clamp_min(0.0);
  return {centre, covariance.inverse(), g.opacities.sigmoid(),
          torch::cat({colour, torch::ones_like(depth).unsqueeze(1), depth.unsqueeze(1)}, 1)};
}

/// Indices of the Gaussians that are drawn, nearest first.
Tensor drawn(const Item& g, const Tensor& matrix, const Tensor& camera_centre, double z_near) {
  const torch::NoGradGuard no_gradient;
  const Tensor h = torch::matmul(g.positions, matrix.slice(1, 0, 3).t()) + matrix.select(1, 3);
  const Tensor centre = h.slice(1, 0, 2) / h.slice(1, 2, 3), offset = g.positions - camera_centre,
               length = g.rotations.norm(2, 1);
  Tensor visible = (h.select(1, 2) >= z_near) & (centre.abs() < kernels::kMaxSplatPixel).all(1) &
                   (length > kernels::kMinQuaternion) & (length < kernels::kMaxQuaternion) &
                   (g.opacities.sigmoid() >= kernels::kMinSplatAlpha);
  for (const Tensor& t : {g.positions, g.rotations, g.log_scales, g.opacities.unsqueeze(1), g.harmonics.flatten(1)})
    visible = visible & t.isfinite().all(1);
  if (g.normals.defined()) visible = visible & ((g.normals * offset).sum(1) <= 0);
  const Tensor index = visible.nonzero().squeeze(1);
  return index.index_select(0, std::get<1>(offset.norm(2, 1).index_select(0, index).sort(true, 0, false)));
}

/// Blends M Gaussians in all pixels. @return [H,W,5]
Tensor blend(const Screen& g, std::int64_t height, std::int64_t width) {
  const Tensor x = torch::arange(width, g.centre.options()) + 0.5, y = torch::arange(height, g.centre.options()) + 0.5;
  const Tensor dx = x.view({1, 1, -1}) - g.centre.select(1, 0).view({-1, 1, 1}),
               dy = y.view({1, -1, 1}) - g.centre.select(1, 1).view({-1, 1, 1});
  const auto conic = [&](int i, int j) { return g.conic.select(1, i).select(1, j).view({-1, 1, 1}); };
  const Tensor power = -0.5 * (conic(0, 0) * dx * dx + conic(1, 1) * dy * dy) - conic(0, 1) * dx * dy;
  const Tensor reached = g.opacity.view({-1, 1, 1}) * power.exp();  // [M,H,W]
  Tensor alpha = torch::where(reached >= kernels::kMinSplatAlpha, reached.clamp_max(kernels::kMaxSplatAlpha),
                              torch::zeros_like(reached));
  const Tensor left = (1 - alpha).cumprod(0);
  const Tensor before = torch::cat({torch::ones_like(left.slice(0, 0, 1)), left.slice(0, 0, -1)}, 0);
  const Tensor weight = torch::where(before >= kernels::kMinTransmittance, alpha * before, torch::zeros_like(alpha));
  return torch::matmul(weight.permute({1, 2, 0}), g.value);
}

}  // namespace

SplatImage reference(const Splats& splats, const Cameras& cameras, std::int64_t height, std::int64_t width,
                     const SplatOptions& options) {
  const std::int64_t batch = splats.positions.size(0), views = cameras.projection.size(1);
  const auto type = splats.positions.scalar_type();
  std::vector<Tensor> images;
  for (std::int64_t b = 0; b < batch; ++b) {
    for (std::int64_t c = 0; c < views; ++c) {
      const Tensor matrix = cameras.projection[b][c].to(type), centre = cameras.centre[b][c].to(type);
      const Item all(splats, b);
      const Tensor index = drawn(all, matrix, centre, options.z_near);
      images.push_back(index.numel() == 0
                           ? torch::zeros({height, width, 5}, splats.positions.options())
                           : blend(project_item(all.at(index), matrix, centre, height, width), height, width));
    }
  }
  const Tensor all =
      images.empty() ? torch::zeros({0, height, width, 5}, splats.positions.options()) : torch::stack(images);
  const Tensor image = all.view({batch, views, height, width, 5});
  return {image.slice(4, 0, 3), image.select(4, 3), options.depth ? image.select(4, 4) : Tensor()};
}

}  // namespace splats
}  // namespace doppel
