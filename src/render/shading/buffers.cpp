#include "doppel/render/shading/buffers.h"

#include <torch/utils.h>

#include <array>

#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"
#include "doppel/render/raster/face_table.h"
#include "doppel/render/shading/shading_terms.h"
#include "doppel/render/shading/surface_pixels.h"

namespace doppel {

using torch::Tensor;

namespace {

bool draws_with_shade(RenderMode mode) {
  return mode == RenderMode::colour || mode == RenderMode::albedo || mode == RenderMode::shading;
}

/// The options and the texture with which `shade` draws a mode.
struct ModeAppearance {
  ShadingOptions options;
  Tensor texture;
};
ModeAppearance appearance_of(const RenderScene& scene, RenderMode mode, const ShadingOptions& options) {
  if (mode == RenderMode::shading && !scene.lighting.defined()) {
    fail<UsageError>("render_mode: mode shading needs lighting coefficients [B,C,3,9]; the scene has none");
  }
  const bool lit = scene.lighting.defined() && options.lit;
  ModeAppearance result{options, mode == RenderMode::shading ? Tensor() : scene.texture};
  result.options.lit = mode == RenderMode::shading || (mode == RenderMode::colour && lit);
  return result;
}

/// The values of the surface in the pixels that it covers. @return [P,channels]
Tensor surface_values(const RenderScene& scene, const RenderMesh& mesh, const shading::Pixels& pixels, RenderMode mode,
                      bool flip) {
  if (mode == RenderMode::mask) return torch::ones({pixels.pixel.size(0), 1}, scene.vertices.options());
  const shading::ViewTensors views = shading::view_tensors("render_mode", scene.projection);
  const Tensor b = shading::barycentrics(pixels, scene.vertices, views);
  if (mode == RenderMode::normal) return shading::pixel_normals(pixels, b, scene.vertices, mesh, views, flip);
  if (mode == RenderMode::uv) {
    const Tensor uv = mesh.corner_uvs.index_select(0, pixels.face);
    return shading::interpolate(b, uv.select(1, 0), uv.select(1, 1), uv.select(1, 2));
  }
  const Tensor points = scene.vertices.reshape({-1, 3});
  std::array<Tensor, 3> at;
  for (std::size_t k = 0; k < 3; ++k) at[k] = points.index_select(0, pixels.corner[k]);
  const Tensor x = shading::interpolate(b, at[0], at[1], at[2]);
  if (mode == RenderMode::position) return x;
  const Tensor centre = views.centre.view({-1, 3}).to(x.dtype()).index_select(0, pixels.view);
  return (x - centre).norm(2, 1, true);
}

}  // namespace

Tensor render_mode(const RenderScene& scene, const RenderMesh& mesh, std::int64_t height, std::int64_t width,
                   RenderMode mode, const ShadingOptions& options) {
  const torch::NoGradGuard no_gradient;
  if (draws_with_shade(mode)) {
    const ModeAppearance look = appearance_of(scene, mode, options);
    return shade(scene.vertices, look.texture, scene.lighting, scene.projection, mesh, height, width, look.options)
        .colour;
  }
  check_floats("render_mode", "vertices", scene.vertices, {-1, mesh.num_vertices, 3});
  check_floats("render_mode", "projection", scene.projection, {scene.vertices.size(0), -1, 3, 4});
  if (mode == RenderMode::uv && !mesh.has_uvs()) {
    fail<UsageError>("render_mode: mode uv, but the mesh has no UVs; give it `vt` coordinates");
  }
  const shading::Pixels pixels =
      shading::visible_pixels(scene.vertices, scene.projection, mesh, height, width, options.z_near);
  const Tensor values = surface_values(scene, mesh, pixels, mode, options.flip_normals);
  const std::int64_t views = scene.vertices.size(0) * scene.projection.size(1);
  return torch::zeros({views * height * width, values.size(1)})
      .index_copy_(0, pixels.pixel, values)
      .view({scene.vertices.size(0), scene.projection.size(1), height, width, values.size(1)});
}

SupersampledImage render_supersampled(const RenderScene& scene, const RenderMesh& mesh, std::int64_t height,
                                      std::int64_t width, RenderMode mode, int factor, const ShadingOptions& options) {
  if (factor < 1 || factor > 8) fail<UsageError>("render_supersampled: factor is {}; it must be 1 to 8", factor);
  render::check_image_size(height, width, "render_supersampled");
  render::check_image_size(height * factor, width * factor, "render_supersampled");
  check_floats("render_supersampled", "projection", scene.projection, {-1, -1, 3, 4});
  const torch::NoGradGuard no_gradient;
  if (draws_with_shade(mode)) {
    const ModeAppearance look = appearance_of(scene, mode, options);
    return shade_supersampled(scene.vertices, look.texture, scene.lighting, scene.projection, mesh, height, width,
                              factor, look.options);
  }
  RenderScene fine = scene;
  fine.projection = scene.projection.clone();
  fine.projection.slice(2, 0, 2).mul_(factor);  // pixel edges scale, not pixel centres
  const auto average = [&](const Tensor& t) {
    return t.view({t.size(0), t.size(1), height, factor, width, factor, t.size(4)}).mean({3, 5});
  };
  const Tensor image = render_mode(fine, mesh, height * factor, width * factor, mode, options);
  const Tensor mask = render_mode(fine, mesh, height * factor, width * factor, RenderMode::mask, options);
  return {average(image), average(mask).squeeze(4)};
}

}  // namespace doppel
