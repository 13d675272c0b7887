#include "doppel/train/chroma_term.h"

#include "doppel/losses/images.h"
#include "doppel/render/shading/shading.h"

namespace doppel {

void describe_keys(const Keys& keys, ChromaTermOptions& options) {
  keys("smoothing", options.chroma.smoothing, at_least(0.0), "Gaussian on drawing and filmed image, pixels");
  keys("target_gradient", options.target_gradient,
       "add the gradient of the filmed image to that of the drawing: convergence from farther away");
}

LossTerm chroma_term(const Batch& batch, const torch::Tensor& vertices, const RenderMesh& mesh,
                     const Appearance& appearance, const ChromaTermOptions& options, Profile& profile) {
  ShadedImage drawn;
  torch::Tensor target;
  {
    ProfileScope scope(profile, "draw");
    drawn = draw(mesh, vertices, appearance, batch.image_projection, batch.image.size(2), batch.image.size(3));
    target = image_float(batch.image);
    if (options.target_gradient)
      target = target_on_surface(vertices, batch.image_projection, mesh, target, TargetOptions{}, &drawn);
  }
  ProfileScope scope(profile, "chroma");
  return {"chroma", chroma_loss(drawn.colour, drawn.mask, target, batch.image_mask, options.chroma), options.weight,
          [mask = drawn.mask, person = batch.image_mask] { return static_cast<double>(chroma_pixels(mask, person)); }};
}

}  // namespace doppel
