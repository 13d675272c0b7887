#include "doppel/actor/draw.h"

namespace doppel {

Appearance static_appearance(const TrainedActor& actor) { return {actor.static_texture, {}}; }

Appearance lit_appearance(TrainedActor& actor, const torch::Tensor& cameras) {
  return {actor.static_texture, actor.lighting->forward(cameras)};
}

Appearance dynamic_appearance(TrainedActor& actor, const torch::Tensor& dof_window, const torch::Tensor& projection) {
  return {actor.texture(dof_window, projection), {}};
}

ShadedImage draw(const RenderMesh& mesh, const torch::Tensor& vertices, const Appearance& appearance,
                 const torch::Tensor& projection, std::int64_t height, std::int64_t width, bool nearest) {
  ShadingOptions options;
  options.lit = appearance.lighting.defined();
  options.nearest = nearest;
  return shade(vertices, appearance.texture, appearance.lighting, projection, mesh, height, width, options);
}

SupersampledImage draw_filmed(const RenderMesh& mesh, const torch::Tensor& vertices, const Appearance& appearance,
                              const torch::Tensor& projection, std::int64_t height, std::int64_t width, int samples) {
  ShadingOptions options;
  options.lit = appearance.lighting.defined();
  return render_supersampled({vertices, projection, appearance.texture, appearance.lighting}, mesh, height, width,
                             RenderMode::colour, samples, options);
}

SplatImage draw_gaussians(TrainedActor& actor, const torch::Tensor& dof_window, const torch::Tensor& projection,
                          const torch::Tensor& vertices, std::int64_t height, std::int64_t width) {
  const torch::NoGradGuard no_grad;
  return draw_splats(actor.splats(dof_window, projection, vertices), projection.unsqueeze(1), height, width);
}

}  // namespace doppel
