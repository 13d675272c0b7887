#include <torch/types.h>

#include "doppel/render/lighting/sh_lighting.h"
#include "doppel/render/raster/rasterizer.h"
#include "doppel/render/shading/shading_terms.h"
#include "doppel/render/shading/surface_pixels.h"

namespace doppel::shading {

using torch::Tensor;

Pixels visible_pixels(const Tensor& vertices, const Tensor& projection, const RenderMesh& mesh, std::int64_t height,
                      std::int64_t width, float z_near) {
  Rasterizer rasterizer(mesh.faces, {z_near, false});
  const Tensor face_id = rasterizer
                             .rasterize_projected(vertices.detach().to(torch::kFloat32),
                                                  projection.detach().to(torch::kFloat32), height, width)
                             .face_id.to(torch::kInt64);
  Pixels out;
  out.mask = (face_id >= 0).view({projection.size(0), projection.size(1), height, width});
  out.pixel = out.mask.flatten().nonzero().squeeze(1);
  out.face = face_id.flatten().index_select(0, out.pixel);
  out.view = out.pixel.div(height * width, "floor");
  out.item = out.view.div(std::max<std::int64_t>(projection.size(1), 1), "floor");
  const Tensor in_view = out.pixel - out.view * (height * width), row = in_view.div(width, "floor");
  out.u = (in_view - row * width).to(vertices.dtype()) + 0.5;
  out.v = row.to(vertices.dtype()) + 0.5;
  const Tensor corners = mesh.faces.to(torch::kInt64).index_select(0, out.face);
  for (int k = 0; k < 3; ++k) out.corner[k] = corners.select(1, k) + out.item * vertices.size(1);
  return out;
}

namespace {

Tensor row_dot(const Tensor& a, const Tensor& b) { return (a * b).sum(1); }

}  // namespace

Tensor barycentrics(const Pixels& pixels, const Tensor& vertices, const ViewTensors& views) {
  const auto dtype = vertices.scalar_type();
  const Tensor points = vertices.reshape({-1, 3});
  const Tensor centre = views.centre.view({-1, 3}).to(dtype).index_select(0, pixels.view);
  const Tensor inverse = views.ray.view({-1, 3, 3}).to(dtype).index_select(0, pixels.view);
  const Tensor pixel = torch::stack({pixels.u, pixels.v, torch::ones_like(pixels.u)}, 1);
  const Tensor ray = torch::matmul(inverse, pixel.unsqueeze(2)).squeeze(2);
  Tensor r[3];
  for (int k = 0; k < 3; ++k) r[k] = points.index_select(0, pixels.corner[k]) - centre;
  const Tensor p = r[1] - r[0], q = r[2] - r[0], n = torch::cross(p, q, 1);
  const Tensor w1 = torch::cross(q, r[0], 1), w2 = torch::cross(r[0], p, 1);
  const Tensor g = torch::stack({row_dot(n - w1 - w2, ray), row_dot(w1, ray), row_dot(w2, ray)}, 1);

  // A pixel that is not strictly inside its face is clamped to the face, without gradient.
  const Tensor total = g.detach().sum(1, true);
  const Tensor limited =
      (g.detach() * torch::where(total < 0, -torch::ones_like(total), torch::ones_like(total))).clamp_min(0);
  const Tensor limited_total = limited.sum(1, true);
  const Tensor solid = limited_total > 0;
  const Tensor fixed = torch::where(solid, limited / torch::where(solid, limited_total, torch::ones_like(total)),
                                    torch::full_like(limited, 1.0 / 3));
  const Tensor volume = row_dot(r[0], n).detach();
  const Tensor steep = volume.square() > kGrazing * kGrazing * row_dot(r[0], r[0]).detach() * row_dot(n, n).detach();
  const Tensor moves = ((fixed > 0).all(1) & steep).unsqueeze(1);
  const Tensor safe = torch::where(moves, g, torch::ones_like(g));
  return torch::where(moves, safe / safe.sum(1, true), fixed);
}

Tensor interpolate(const Tensor& b, const Tensor& at0, const Tensor& at1, const Tensor& at2) {
  return b.slice(1, 0, 1) * at0 + b.slice(1, 1, 2) * at1 + b.slice(1, 2, 3) * at2;
}

Tensor pixel_normals(const Pixels& pixels, const Tensor& b, const Tensor& vertices, const RenderMesh& mesh,
                     const ViewTensors& views, bool flip) {
  const Tensor sums = vertex_normal_sums(vertices, mesh).reshape({-1, 3});
  Tensor at[3];
  for (int k = 0; k < 3; ++k) at[k] = sums.index_select(0, pixels.corner[k]);
  const Tensor n = interpolate(b, at[0], at[1], at[2]);
  const Tensor square = row_dot(n, n).unsqueeze(1);
  const Tensor solid = square.detach() > kTinyNormal;
  const Tensor length = torch::where(solid, square, torch::ones_like(square)).sqrt();
  Tensor unit = torch::where(solid, n / length, torch::zeros_like(n));
  if (!flip) return unit;
  const Tensor inverse = views.ray.view({-1, 3, 3}).to(vertices.scalar_type()).index_select(0, pixels.view);
  const Tensor pixel = torch::stack({pixels.u, pixels.v, torch::ones_like(pixels.u)}, 1);
  const Tensor ray = torch::matmul(inverse, pixel.unsqueeze(2)).squeeze(2);
  const Tensor away = (row_dot(n.detach(), ray) > 0).unsqueeze(1);
  return torch::where(away, -unit, unit);
}

namespace {

/// Bilinear (or nearest) look-up. @param uv [P,2] @param image int64 [P], index of the texture
Tensor sample(const Tensor& texture, const Tensor& image, const Tensor& uv, bool nearest) {
  const std::int64_t height = texture.size(1), width = texture.size(2);
  Tensor x = uv.select(1, 0) * static_cast<double>(width) - 0.5;
  Tensor y = (1 - uv.select(1, 1)) * static_cast<double>(height) - 0.5;
  if (nearest) {
    x = (x.detach() + 0.5).clamp(0, static_cast<double>(width - 1)).floor();
    y = (y.detach() + 0.5).clamp(0, static_cast<double>(height - 1)).floor();
  }
  x = x.clamp(0, static_cast<double>(width - 1));
  y = y.clamp(0, static_cast<double>(height - 1));
  const Tensor x0 = x.detach().floor().clamp_max(static_cast<double>(width - 2));
  const Tensor y0 = y.detach().floor().clamp_max(static_cast<double>(height - 2));
  const Tensor fx = (x - x0).unsqueeze(1), fy = (y - y0).unsqueeze(1);
  const Tensor texels = texture.reshape({-1, 3});
  const Tensor first = (image * height + y0.to(torch::kInt64)) * width + x0.to(torch::kInt64);
  const auto at = [&](std::int64_t offset) { return texels.index_select(0, first + offset); };
  const Tensor top = at(0) * (1 - fx) + at(1) * fx, bottom = at(width) * (1 - fx) + at(width + 1) * fx;
  return top * (1 - fy) + bottom * fy;
}

Tensor albedo(const Pixels& pixels, const Tensor& b, const Tensor& texture, const RenderMesh& mesh, std::int64_t batch,
              bool nearest) {
  const Tensor uvs = mesh.corner_uvs.to(b.dtype()).index_select(0, pixels.face);  // [P,3,2]
  const Tensor uv = interpolate(b, uvs.select(1, 0), uvs.select(1, 1), uvs.select(1, 2));
  const Tensor image = texture.size(0) == 1       ? torch::zeros_like(pixels.view)
                       : texture.size(0) == batch ? pixels.item
                                                  : pixels.view;
  return sample(texture, image, uv, nearest);
}

/// Gradient of the images along u and v, 0 within `radius` of the border. @param images [V,H,W,3]
/// @return 2 x [V,H,W,3]
std::pair<Tensor, Tensor> gradients(const Tensor& images, int radius) {
  const std::int64_t height = images.size(1), width = images.size(2);
  Tensor by_u = torch::zeros_like(images), by_v = torch::zeros_like(images);
  if (height <= 2 * radius || width <= 2 * radius) return {by_u, by_v};
  const auto inner = [&](std::int64_t du, std::int64_t dv) {
    return images.slice(1, radius + dv, height - radius + dv).slice(2, radius + du, width - radius + du);
  };
  Tensor sum_u = torch::zeros_like(inner(0, 0)), sum_v = torch::zeros_like(sum_u);
  double norm = 0;
  for (int v = -radius; v <= radius; ++v) {
    for (int u = -radius; u <= radius; ++u) {
      if (u == 0 && v == 0) continue;
      const double square = u * u + v * v;
      sum_u += inner(u, v) * (u / square);
      sum_v += inner(u, v) * (v / square);
      norm += u * u / square;
    }
  }
  by_u.slice(1, radius, height - radius).slice(2, radius, width - radius) = sum_u / norm;
  by_v.slice(1, radius, height - radius).slice(2, radius, width - radius) = sum_v / norm;
  return {by_u, by_v};
}

}  // namespace

ShadedImage reference(const Tensor& vertices, const Tensor& texture, const Tensor& lighting, const Tensor& projection,
                      const RenderMesh& mesh, std::int64_t height, std::int64_t width, const ShadingOptions& options) {
  const std::int64_t batch = vertices.size(0), cameras = projection.size(1);
  const ViewTensors views = view_tensors("shade", projection);
  const Pixels pixels = visible_pixels(vertices, projection, mesh, height, width, options.z_near);
  const Tensor b = barycentrics(pixels, vertices, views);
  Tensor colour = torch::ones({pixels.pixel.size(0), 3}, vertices.options());
  if (options.lit) {
    const Tensor normal = pixel_normals(pixels, b, vertices, mesh, views, options.flip_normals);
    const Tensor rows = lighting.expand({batch, cameras, 3, kShBasis}).reshape({-1, 3, kShBasis});
    const Tensor light = rows.index_select(0, pixels.view);  // [P,3,9]
    colour = torch::matmul(light, sh_basis(normal).unsqueeze(2)).squeeze(2);
  }
  if (texture.defined()) colour = colour * albedo(pixels, b, texture, mesh, batch, options.nearest);
  const Tensor image =
      torch::zeros({batch * cameras * height * width, 3}, vertices.options()).index_copy(0, pixels.pixel, colour);
  return {image.view({batch, cameras, height, width, 3}), pixels.mask, {}};
}

Tensor target_reference(const Tensor& vertices, const Tensor& projection, const RenderMesh& mesh, const Tensor& target,
                        const TargetOptions& options) {
  const std::int64_t cameras = projection.size(1), height = target.size(2), width = target.size(3);
  const Pixels pixels = visible_pixels(vertices, projection, mesh, height, width, options.z_near);
  const Tensor b = barycentrics(pixels, vertices.detach(), view_tensors("target_on_surface", projection));
  const Tensor points = vertices.reshape({-1, 3});
  Tensor at[3];
  for (int k = 0; k < 3; ++k) at[k] = points.index_select(0, pixels.corner[k]);
  const Tensor x = interpolate(b, at[0], at[1], at[2]);
  const Tensor matrix = projection.detach().reshape({-1, 3, 4}).index_select(0, pixels.view);
  const Tensor h = torch::matmul(matrix.slice(2, 0, 3), x.unsqueeze(2)).squeeze(2) + matrix.select(2, 3);
  const Tensor pixel = h.slice(1, 0, 2) / h.slice(1, 2, 3);
  const Tensor move = pixel - pixel.detach();  // 0, with a gradient
  const auto [by_u, by_v] = gradients(target.detach().reshape({-1, height, width, 3}), options.radius);
  const Tensor change = by_u.reshape({-1, 3}).index_select(0, pixels.pixel) * move.slice(1, 0, 1) +
                        by_v.reshape({-1, 3}).index_select(0, pixels.pixel) * move.slice(1, 1, 2);
  return target + torch::zeros({target.numel() / 3, 3}, target.options())
                      .index_copy(0, pixels.pixel, change)
                      .view({vertices.size(0), cameras, height, width, 3});
}

}  // namespace doppel::shading
