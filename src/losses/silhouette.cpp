#include "doppel/losses/silhouette.h"

#include <ATen/Parallel.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>

#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"
#include "doppel/core/tensor/reference_scope.h"
#include "doppel/losses/silhouette_terms.h"
#include "doppel/render/outline/boundary.h"

namespace doppel {

using torch::Tensor;

namespace {

const char* const kSilhouetteOp = "silhouette_loss";

void check_contour(const SilhouetteTarget& target, std::int64_t views) {
  check_shape(kSilhouetteOp, "contour", target.contour, {-1, 2}, "[P,2]");
  const Tensor& offsets = target.contour_offsets;
  check_tensor(kSilhouetteOp, "contour_offsets", offsets, {torch::kInt64}, {views + 1}, "[B*C+1]");
  const Tensor rows = offsets.contiguous();
  const std::int64_t* row = rows.data_ptr<std::int64_t>();
  bool ordered = row[0] == 0 && row[views] == target.contour.size(0);
  for (std::int64_t i = 0; i < views; ++i) ordered = ordered && row[i] <= row[i + 1];
  if (!ordered) {
    fail<UsageError>("{}: contour_offsets must increase from 0 to the {} contour pixels", kSilhouetteOp,
                     target.contour.size(0));
  }
}

void check_target(const Tensor& vertices, const Tensor& faces, const SilhouetteTarget& target,
                  const SilhouetteOptions& options) {
  check_shape(kSilhouetteOp, "vertices", vertices, {-1, -1, 3}, "[B,N,3]");
  check_tensor(kSilhouetteOp, "faces", faces, {torch::kInt32, torch::kInt64}, {-1, 3}, "[F,3]");
  const std::int64_t batch = vertices.size(0);
  check_shape(kSilhouetteOp, "projection", target.projection, {batch, -1, 3, 4}, "[B,C,3,4]");
  const std::int64_t cameras = target.projection.size(1);
  check_shape(kSilhouetteOp, "distance", target.distance, {batch, cameras, -1, -1}, "[B,C,S,S]");
  if (target.distance.size(2) != target.distance.size(3)) {
    fail<UsageError>("{}: distance must be square, found {}", kSilhouetteOp, describe(target.distance));
  }
  check_tensor(kSilhouetteOp, "valid", target.valid, {torch::kBool}, {batch, cameras}, "[B,C]");
  if (options.unit == SilhouetteUnit::image_pixels || options.boundary == SilhouetteBoundary::outline) {
    check_shape(kSilhouetteOp, "pixel_scale", target.pixel_scale, {batch, cameras}, "[B,C]");
  }
  if (!(options.distance_scale > 0) || !(options.contour_radius > 0)) {
    fail<UsageError>("{}: distance_scale {} and contour_radius {} must be greater than 0", kSilhouetteOp,
                     options.distance_scale, options.contour_radius);
  }
  check_contour(target, batch * cameras);
}

/// Sums the area-weighted normals of the faces at their corners, then scales each to unit length.
template <typename T>
void add_normals(const T* x, const std::int64_t* faces, std::int64_t num_vertices, std::int64_t num_faces, T* normals) {
  std::fill_n(normals, 3 * num_vertices, T(0));
  for (std::int64_t f = 0; f < num_faces; ++f) {
    const T* a = x + 3 * faces[3 * f];
    const T* b = x + 3 * faces[3 * f + 1];
    const T* c = x + 3 * faces[3 * f + 2];
    const T p[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]}, q[3] = {c[0] - a[0], c[1] - a[1], c[2] - a[2]};
    const T n[3] = {p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]};
    for (int k = 0; k < 3; ++k) {
      T* sum = normals + 3 * faces[3 * f + k];
      for (int d = 0; d < 3; ++d) sum[d] += n[d];
    }
  }
  for (std::int64_t i = 0; i < num_vertices; ++i) {
    T* n = normals + 3 * i;
    const T length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (int d = 0; d < 3; ++d) n[d] = length > 0 ? n[d] / length : T(0);
  }
}

/// Distance of the centre of a contour pixel, of a drawing or a mask, from the outline, pixels.
constexpr double kPixelToOutline = 0.5;

silhouette::ResidualScales residual_scales(const SilhouetteTarget& target, const SilhouetteOptions& options) {
  const Tensor one = torch::ones(target.valid.sizes());
  Tensor model_to_data = one, data_to_model = one;
  // Squared residuals in image pixels, times the width of a crop pixel in image pixels.
  if (options.boundary == SilhouetteBoundary::outline)
    model_to_data = data_to_model = target.pixel_scale.pow(1.5);
  else if (options.unit == SilhouetteUnit::image_pixels)
    model_to_data = target.pixel_scale;
  return {model_to_data / options.distance_scale, data_to_model / options.contour_radius};
}

SilhouetteLoss evaluate(const Tensor& points, const Tensor& normals, const Tensor& boundary,
                        const SilhouetteTarget& target, const SilhouetteOptions& options) {
  const silhouette::ResidualScales scales = residual_scales(target, options);
  return takes_kernel(points) ? silhouette::fused(points, normals, boundary, target, scales, options)
                              : silhouette::reference(points, normals, boundary, target, scales, options);
}

/// Values of vertices at points on faces, with gradients. @param values [B,N,3] @return [V,P,3]
Tensor on_faces(const Tensor& values, const OutlinePoints& outline) {
  const std::int64_t views = outline.used.size(0), cameras = views / std::max<std::int64_t>(values.size(0), 1);
  const Tensor item = at::arange(views, torch::kInt64).div(std::max<std::int64_t>(cameras, 1), "floor");
  const Tensor rows = outline.corners + (item * values.size(1)).view({-1, 1, 1});
  // An embedding, whose gradient is summed row by row in order.
  const Tensor corners = at::embedding(values.reshape({-1, 3}), rows);  // [V,P,3,3]
  return (corners * outline.barycentrics.to(values.scalar_type()).unsqueeze(-1)).sum(2);
}

}  // namespace

Tensor silhouette_normals(const Tensor& vertices, const Tensor& faces) {
  check_shape("silhouette_normals", "vertices", vertices, {-1, -1, 3}, "[B,N,3]");
  check_tensor(kSilhouetteOp, "faces", faces, {torch::kInt32, torch::kInt64}, {-1, 3}, "[F,3]");
  const Tensor x = vertices.detach().contiguous(), f = faces.to(torch::kInt64).contiguous();
  const std::int64_t num_vertices = x.size(1), num_faces = f.size(0);
  if (num_faces > 0 && (f.min().item<std::int64_t>() < 0 || f.max().item<std::int64_t>() >= num_vertices)) {
    fail<UsageError>("silhouette_normals: faces must name vertices 0 to {}, found {} to {}", num_vertices - 1,
                     f.min().item<std::int64_t>(), f.max().item<std::int64_t>());
  }
  Tensor normals = torch::empty_like(x);
  AT_DISPATCH_FLOATING_TYPES(x.scalar_type(), "silhouette_normals", [&] {
    at::parallel_for(0, x.size(0), 1, [&](std::int64_t begin, std::int64_t end) {
      for (std::int64_t b = begin; b < end; ++b) {
        add_normals(x.data_ptr<scalar_t>() + 3 * num_vertices * b, f.data_ptr<std::int64_t>(), num_vertices, num_faces,
                    normals.data_ptr<scalar_t>() + 3 * num_vertices * b);
      }
    });
  });
  return normals;
}

SilhouetteLoss silhouette_loss(const Tensor& vertices, const Tensor& faces, const SilhouetteTarget& target,
                               const SilhouetteOptions& options) {
  check_target(vertices, faces, target, options);
  if (options.boundary == SilhouetteBoundary::outline) {
    const OutlinePoints outline =
        outline_points(vertices.detach().to(torch::kFloat32), target.projection.to(torch::kFloat32), faces,
                       target.distance.size(2), target.distance.size(3), target.valid);
    return silhouette_loss(vertices, faces, outline, target, options);
  }
  BoundaryOptions boundary_options;
  boundary_options.visible_only = options.visible_only;
  const Tensor boundary =
      boundary_vertices(vertices.detach().to(torch::kFloat32), target.projection.to(torch::kFloat32), faces,
                        target.distance.size(2), target.distance.size(3), target.valid, boundary_options);
  return silhouette_loss(vertices, faces, boundary, target, options);
}

SilhouetteLoss silhouette_loss(const Tensor& vertices, const Tensor& faces, const Tensor& boundary,
                               const SilhouetteTarget& target, const SilhouetteOptions& options) {
  check_target(vertices, faces, target, options);
  check_tensor(kSilhouetteOp, "boundary", boundary, {torch::kBool},
               {vertices.size(0), target.projection.size(1), vertices.size(1)}, "[B,C,N]");
  return evaluate(vertices, silhouette_normals(vertices, faces), boundary, target, options);
}

SilhouetteLoss silhouette_loss(const Tensor& vertices, const Tensor& faces, const OutlinePoints& outline,
                               const SilhouetteTarget& target, const SilhouetteOptions& options) {
  SilhouetteOptions at_centres = options;
  at_centres.boundary = SilhouetteBoundary::outline;
  at_centres.inset += kPixelToOutline;
  check_target(vertices, faces, target, at_centres);
  const std::int64_t views = target.valid.numel(), size = target.distance.size(3);
  check_tensor(kSilhouetteOp, "outline.used", outline.used, {torch::kBool}, {views, -1}, "[V,P]");
  // Each view becomes a batch item, with the points as vertices.
  SilhouetteTarget by_view = target;
  by_view.projection = target.projection.reshape({views, 1, 3, 4});
  by_view.distance = target.distance.reshape({views, 1, size, size});
  by_view.pixel_scale = target.pixel_scale.reshape({views, 1});
  by_view.valid = target.valid.reshape({views, 1});
  return evaluate(on_faces(vertices, outline), on_faces(silhouette_normals(vertices, faces), outline),
                  outline.used.unsqueeze(1), by_view, at_centres);
}

}  // namespace doppel
