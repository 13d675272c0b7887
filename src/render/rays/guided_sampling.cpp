#include "doppel/render/rays/guided_sampling.h"

#include <ATen/Parallel.h>

#include <algorithm>
#include <cmath>

#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"
#include "doppel/render/projection.h"
#include "doppel/render/raster/face_table.h"

namespace doppel {

using torch::Tensor;

namespace {

/// Sine of the angle between ray and face below which their intersection has no gradient.
constexpr double kGrazing = 0.01;
/// A camera is inside the mesh if at least this fraction of the covered pixels shows the inside of faces. From outside,
/// a closed surface shows none, and a surface that intersects itself shows a few.
constexpr double kInsidePart = 0.5;

void check_options(const GuideOptions& options) {
  if (options.stencil < 1 || options.stencil % 2 == 0)
    fail<UsageError>("guided sampling: the stencil is {} pixels wide; it must be odd and at least 1", options.stencil);
  if (!(options.t_mi > 0) || !(options.t_ma > 0))
    fail<UsageError>("guided sampling: t_mi is {} m and t_ma {} m; both must be greater than 0", options.t_mi,
                     options.t_ma);
}

void check_pixels(const Tensor& pixels, int64_t height, int64_t width) {
  check_tensor("guided sampling", "pixels", pixels, {torch::kInt64}, {-1, 2}, "[R,2]");
  if (pixels.size(0) == 0) return;
  const Tensor low = pixels.amin(0), high = pixels.amax(0);
  const int64_t x = high[0].item<int64_t>(), y = high[1].item<int64_t>();
  if (low.min().item<int64_t>() < 0 || x >= width || y >= height)
    fail<UsageError>("guided sampling: a pixel lies outside the image of {} x {}: columns {} to {}, rows {} to {}",
                     width, height, low[0].item<int64_t>(), x, low[1].item<int64_t>(), y);
}

Tensor corner_of(const Tensor& vertices, const Tensor& faces, int k) {
  return vertices.index_select(-2, faces.select(1, k));
}
Tensor normals_of(const Tensor& vertices, const Tensor& faces) {
  const Tensor first = corner_of(vertices, faces, 0);
  return torch::cross(corner_of(vertices, faces, 1) - first, corner_of(vertices, faces, 2) - first, -1);
}

/// Multiplies the depth along the axis by the length of each pixel's ray of depth 1.
Tensor along_rays(const Tensor& depth, const Tensor& projection) {
  const int64_t V = depth.size(0), H = depth.size(1), W = depth.size(2);
  Tensor distance = depth.clone();
  const Tensor world_from_pixel =
      torch::inverse(projection.to(torch::kFloat64).reshape({V, 3, 4}).narrow(2, 0, 3)).contiguous();
  at::parallel_for(0, V * H, 16, [&](int64_t begin, int64_t end) {
    for (int64_t line = begin; line < end; ++line) {
      const double *m = world_from_pixel.data_ptr<double>() + 9 * (line / H), v = static_cast<double>(line % H) + 0.5;
      float* row = distance.data_ptr<float>() + line * W;
      for (int64_t x = 0; x < W; ++x) {
        const double u = static_cast<double>(x) + 0.5;
        const double a = m[0] * u + m[1] * v + m[2], b = m[3] * u + m[4] * v + m[5], c = m[6] * u + m[7] * v + m[8];
        row[x] = static_cast<float>(row[x] * std::sqrt(a * a + b * b + c * c));
      }
    }
  });
  return distance;
}

void check_cameras_outside(const Tensor& face_id, const Tensor& faces, const Tensor& vertices,
                           const Tensor& projection) {
  const int64_t C = projection.size(1);
  const Tensor centre = camera_placement(projection).centre;  // [B,C,3]
  const Tensor normal = normals_of(vertices, faces), corner = corner_of(vertices, faces, 0);
  for (int64_t v = 0; v < face_id.size(0); ++v) {
    const Tensor seen = face_id[v].masked_select(face_id[v] >= 0).to(torch::kInt64);
    if (seen.numel() == 0) continue;
    const Tensor inwards = ((corner[v / C] - centre[v / C][v % C]) * normal[v / C]).sum(1) > 0;
    const int64_t count = inwards.index_select(0, seen).sum().item<int64_t>();
    if (static_cast<double>(count) >= kInsidePart * static_cast<double>(seen.numel()))
      fail(
          "guided sampling: camera {} of item {} stands inside the mesh: {} of the {} pixels it covers show the inside "
          "of faces. Move the camera out, or, if it is outside, turn the faces counter-clockwise",
          v % C, v / C, count, seen.numel());
  }
}

/// The pixels with the smallest and the largest distance around a pixel; -1 if there are none.
struct Extremes {
  int64_t nearest = -1, farthest = -1;  ///< row * W + column
};
Extremes extremes_around(const float* distance, int64_t height, int64_t width, int64_t x, int64_t y, int64_t reach) {
  Extremes found;
  for (int64_t row = std::max<int64_t>(0, y - reach); row <= std::min(height - 1, y + reach); ++row)
    for (int64_t column = std::max<int64_t>(0, x - reach); column <= std::min(width - 1, x + reach); ++column) {
      const int64_t here = row * width + column;
      if (!std::isfinite(distance[here])) continue;
      if (found.nearest < 0 || distance[here] < distance[found.nearest]) found.nearest = here;
      if (found.farthest < 0 || distance[here] > distance[found.farthest]) found.farthest = here;
    }
  return found;
}

/// Distances [R] at which the rays through the given pixels (row * W + column) meet the faces seen in these pixels.
Tensor surface_distance(const Tensor& face_id, const Tensor& distance, const Tensor& pixels, const Tensor& faces,
                        const Tensor& vertices, const Tensor& projection) {
  const int64_t width = face_id.size(1);
  const Tensor columns = pixels.remainder(width), rows = torch::div(pixels, width, "floor");
  const PixelRays rays = pixel_rays(projection.to(vertices.scalar_type()), torch::stack({columns, rows}, 1));
  const Tensor seen = faces.index_select(0, face_id.flatten().index_select(0, pixels).to(torch::kInt64));
  const Tensor normal = normals_of(vertices, seen);
  const Tensor slope = (normal * rays.direction).sum(1);
  const Tensor height = (normal * (corner_of(vertices, seen, 0) - rays.origin)).sum(1);
  const Tensor clear = slope.detach().abs() > kGrazing * normal.detach().norm(2, {1});
  const Tensor drawn = distance.flatten().index_select(0, pixels).to(vertices.scalar_type());
  return torch::where(clear, height / torch::where(clear, slope, torch::ones_like(slope)), drawn);
}

}  // namespace

PixelRays pixel_rays(const Tensor& projection, const Tensor& pixels) {
  check_shape("pixel_rays", "projection", projection, {3, 4}, "");
  const Tensor p = projection.to(torch::kFloat64), world_from_pixel = torch::inverse(p.narrow(1, 0, 3));
  const Tensor centres =
      torch::cat({pixels.to(torch::kFloat64) + 0.5, torch::ones({pixels.size(0), 1}, torch::kFloat64)}, 1);
  const Tensor along = torch::matmul(centres, world_from_pixel.t());
  return {camera_placement(projection).centre, (along / along.norm(2, {1}, true)).to(projection.scalar_type())};
}

Tensor GuideImages::pixels(int64_t view) const { return reached[view].nonzero().flip({1}); }

GuideImages guide_images(Rasterizer& rasterizer, const Tensor& faces, const Tensor& vertices, const Tensor& projection,
                         int64_t height, int64_t width, const GuideOptions& options) {
  const torch::NoGradGuard no_grad;
  check_options(options);
  const RasterImage& drawn = rasterizer.rasterize_projected(vertices, projection, height, width);
  GuideImages guide;
  guide.face_id = drawn.face_id.clone();
  check_cameras_outside(guide.face_id, faces, vertices, projection);
  guide.distance = along_rays(drawn.depth, projection);
  const Tensor covered = (guide.face_id >= 0).to(torch::kFloat32).unsqueeze(1);
  guide.reached = torch::max_pool2d(covered, options.stencil, 1, options.stencil / 2).squeeze(1) > 0;
  return guide;
}

RayInterval guided_interval(const GuideImages& guide, int64_t view, const Tensor& pixels_in, const Tensor& faces,
                            const Tensor& vertices, const Tensor& projection, const GuideOptions& options) {
  check_options(options);
  const int64_t height = guide.face_id.size(1), width = guide.face_id.size(2), R = pixels_in.size(0);
  check_pixels(pixels_in, height, width);
  const Tensor pixels = pixels_in.contiguous(), distance = guide.distance[view].contiguous();
  const Tensor extremes = torch::empty({2, R}, torch::kInt64);  // nearest, farthest
  const int64_t* at = pixels.data_ptr<int64_t>();
  at::parallel_for(0, R, 256, [&](int64_t begin, int64_t end) {
    for (int64_t r = begin; r < end; ++r) {
      const Extremes found =
          extremes_around(distance.data_ptr<float>(), height, width, at[2 * r], at[2 * r + 1], options.stencil / 2);
      extremes.data_ptr<int64_t>()[r] = found.nearest;
      extremes.data_ptr<int64_t>()[R + r] = found.farthest;
    }
  });
  const Tensor known = (extremes[0] >= 0).nonzero().squeeze(1);
  const auto distance_at = [&](int which) {
    return surface_distance(guide.face_id[view], distance, extremes[which].index_select(0, known), faces, vertices,
                            projection);
  };
  const Tensor nothing = torch::zeros({R}, vertices.options().requires_grad(false));
  RayInterval interval;
  interval.near = nothing.index_copy(0, known, (distance_at(0) - options.t_mi).clamp_min(0));
  interval.far = nothing.index_copy(0, known, distance_at(1) + options.t_ma);
  return interval;
}

Tensor draw_pixels(const GuideImages& guide, int64_t view, const Tensor& mask, int64_t count, double in_mask,
                   at::Generator generator) {
  const Tensor reached = guide.reached[view];
  if (mask.sizes() != reached.sizes())
    fail<UsageError>("draw_pixels: the mask is {}, the view {}", describe(mask), describe(reached));
  const Tensor anywhere = reached.nonzero().flip({1});
  if (anywhere.size(0) == 0)
    fail("draw_pixels: the mesh is not seen in view {}, so no ray passes near it; leave such views out", view);
  Tensor inside = (reached & (mask > 0.5)).nonzero().flip({1});
  if (inside.size(0) == 0) inside = anywhere;
  const auto pick = [&](const Tensor& from, int64_t how_many) {
    return from.index_select(0, torch::randint(0, from.size(0), {how_many}, generator, torch::kInt64));
  };
  const auto first = static_cast<int64_t>(in_mask * static_cast<double>(count));
  const Tensor shown = pick(inside, first);
  return torch::cat({shown, pick(anywhere, count - first)});
}

}  // namespace doppel
