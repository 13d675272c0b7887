#pragma once

#include "doppel/actor/draw.h"
#include "doppel/core/options.h"
#include "doppel/core/profile.h"
#include "doppel/data/dataset/batch.h"
#include "doppel/losses/chroma.h"
#include "doppel/train/stage.h"

namespace doppel {

/// How the colours of a surface are compared with the images.
struct ChromaTermOptions {
  double weight = 0.0;  ///< per squared level of 255; 0: not at all
  ChromaOptions chroma;
  bool target_gradient = true;  ///< add the gradient of the filmed image to that of the drawn image
};
/// The keys `smoothing` and `target_gradient` of a section `loss`; stages state the weight themselves.
void describe_keys(const Keys& keys, ChromaTermOptions& options);

/// Draws a surface and compares its chroma with that of the images of the batch (6.16).
/// @param vertices [B,N,3] world metres, with gradients @pre the batch has images
LossTerm chroma_term(const Batch& batch, const torch::Tensor& vertices, const RenderMesh& mesh,
                     const Appearance& appearance, const ChromaTermOptions& options, Profile& profile);

}  // namespace doppel
