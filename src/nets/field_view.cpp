#include "doppel/nets/field_view.h"

namespace doppel {

void describe_keys(const Keys& keys, FieldRays& rays) {
  keys("samples", rays.samples, between(1, 4096), "of a ray");
  keys("stencil", rays.stencil, between(1, 255),
       "side of the window around a ray, pixels, odd; the ray is sampled between the depths in it");
  keys.require("stencil", rays.stencil % 2 == 1, fmt::format("found {}; it must be odd", rays.stencil));
}

using torch::Tensor;

FieldViewer::FieldViewer(const Character& character)
    : closest_(character.mesh), rasterizer_(closest_->faces().to(torch::kInt32)) {}

GuideImages FieldViewer::guide(const Tensor& vertices, const Tensor& projection, int64_t height, int64_t width,
                               const GuideOptions& options) {
  return guide_images(rasterizer_, faces(), vertices.detach().unsqueeze(0).contiguous(),
                      projection.unsqueeze(0).contiguous(), height, width, options);
}

FieldImage FieldViewer::draw(RadianceField& field, const FieldSurface& surface, const Tensor& projection,
                             int64_t height, int64_t width, int stencil, const FieldImageOptions& options) {
  const torch::NoGradGuard no_grad;
  const GuideOptions near_mesh = guide_of(field->config(), stencil);
  const GuideImages seen = guide(surface.vertices, projection.unsqueeze(0), height, width, near_mesh);
  const Tensor pixels = seen.pixels(0);
  const PixelRays rays = pixel_rays(projection, pixels);
  const RayInterval interval = guided_interval(seen, 0, pixels, faces(), surface.vertices, projection, near_mesh);
  const FieldPixels drawn =
      draw_field(field, closest_, surface, rays.origin, rays.direction, interval.near, interval.far, options);
  const Tensor positions = pixels.select(1, 1) * width + pixels.select(1, 0);
  FieldImage image;
  image.colour = torch::zeros({height * width, 3}).index_copy_(0, positions, drawn.colour).view({height, width, 3});
  image.opacity = torch::zeros({height * width}).index_copy_(0, positions, drawn.opacity).view({height, width});
  image.depth =
      torch::zeros({height * width}).index_copy_(0, positions, drawn.depth * (drawn.opacity > 0)).view({height, width});
  return image;
}

GuideOptions guide_of(const RadianceFieldConfig& field, int stencil) {
  GuideOptions options;
  options.t_mi = field.t_mi;
  options.t_ma = field.t_ma;
  options.stencil = stencil;
  return options;
}

}  // namespace doppel
