#pragma once

#include <torch/types.h>

#include "doppel/actor/trained_actor.h"
#include "doppel/render/shading/buffers.h"

namespace doppel {

/// The colours of a surface: texture and lighting.
struct Appearance {
  torch::Tensor texture;   ///< [B or 1,Th,Tw,3] RGB 0..1
  torch::Tensor lighting;  ///< [B or 1,C,3,9]; undefined: unlit
};

/// The static texture, unlit. @pre the template has a texture (TrainedActor::static_texture)
Appearance static_appearance(const TrainedActor& actor);
/// The static texture under the learnt lighting of cameras (6.6). @param cameras int64 [B,C]
Appearance lit_appearance(TrainedActor& actor, const torch::Tensor& cameras);
/// The dynamic texture for a motion window and a camera (6.8), unlit.
/// @param dof_window [B,F+1,D] @param projection [B,3,4]
Appearance dynamic_appearance(TrainedActor& actor, const torch::Tensor& dof_window, const torch::Tensor& projection);

/// Draws a surface, with gradients to vertices, texture and lighting.
/// @param vertices [B,N,3] world metres @param projection [B,C,3,4] pixels from world metres
ShadedImage draw(const RenderMesh& mesh, const torch::Tensor& vertices, const Appearance& appearance,
                 const torch::Tensor& projection, std::int64_t height, std::int64_t width, bool nearest = false);

/// Draws with supersampling, as a camera films: the mean over samples x samples points of each pixel. Without
/// gradients.
SupersampledImage draw_filmed(const RenderMesh& mesh, const torch::Tensor& vertices, const Appearance& appearance,
                              const torch::Tensor& projection, std::int64_t height, std::int64_t width, int samples);

/// Draws the Gaussians of an actor over black. @pre `actor.gaussians` is not null
/// @param dof_window [B,F+1,D] @param projection [B,3,4] pixels from world metres @param vertices [B,N,3]
/// `actor.fine(dof_window)` @return images [B,1,H,W,...]
SplatImage draw_gaussians(TrainedActor& actor, const torch::Tensor& dof_window, const torch::Tensor& projection,
                          const torch::Tensor& vertices, std::int64_t height, std::int64_t width);

}  // namespace doppel
