#pragma once

#include <torch/types.h>

#include <string>

#include "doppel/render/mesh/render_mesh.h"
#include "doppel/render/shading/shading.h"

namespace doppel {

/// The kinds of images, with their channels. The value of the background is always 0.
enum class RenderMode {
  colour,    ///< 3: texture under lighting
  albedo,    ///< 3: texture alone
  normal,    ///< 3: unit normal in world axes, -1..1
  shading,   ///< 3: lighting on white
  depth,     ///< 1: distance from the camera centre, metres (Euclidean, not along the axis)
  mask,      ///< 1: 1 where the mesh is seen
  uv,        ///< 2: texture coordinates, v up
  position,  ///< 3: world, metres
};

/// The inputs of a drawing. `texture` and `lighting` are needed by some modes only, as in `shade`.
struct RenderScene {
  torch::Tensor vertices;    ///< float32 [B,N,3], world, metres
  torch::Tensor projection;  ///< float32 [B,C,3,4], pixels from world metres
  torch::Tensor texture;     ///< [Bt,Th,Tw,3]; undefined: white
  torch::Tensor lighting;    ///< [B,C,3,9] or [1,C,3,9]; undefined in mode colour: unlit
};

/// One image per view, without gradient. @return float32 [B,C,H,W,channels]
/// @throws Error for wrong shapes or types, mode uv or a texture without UVs, mode shading without lighting
torch::Tensor render_mode(const RenderScene& scene, const RenderMesh& mesh, std::int64_t height, std::int64_t width,
                          RenderMode mode, const ShadingOptions& options = {});

/// Draws at `factor` times the resolution and averages factor x factor pixels.
/// @param factor 1 to 8; factor * height and factor * width at most 16384
SupersampledImage render_supersampled(const RenderScene& scene, const RenderMesh& mesh, std::int64_t height,
                                      std::int64_t width, RenderMode mode, int factor,
                                      const ShadingOptions& options = {});

}  // namespace doppel
