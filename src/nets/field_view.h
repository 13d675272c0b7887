#pragma once

/// Images of the radiance field around a mesh.

#include <torch/types.h>

#include "doppel/character/character.h"
#include "doppel/core/options.h"
#include "doppel/layers/closest_point/closest_point.h"
#include "doppel/nets/radiance_field.h"
#include "doppel/render/raster/rasterizer.h"
#include "doppel/render/rays/guided_sampling.h"

namespace doppel {

/// An image of H x W pixels.
struct FieldImage {
  torch::Tensor colour;   ///< float32 [H,W,3] RGB 0..1 over black
  torch::Tensor opacity;  ///< float32 [H,W] 0..1; 0 far from the mesh
  torch::Tensor depth;    ///< float32 [H,W] metres along the pixel's ray; 0 where the opacity is 0
};

/// Sampling of rays in a radiance field: keys `samples` and `stencil` of a section `rays`.
struct FieldRays {
  int samples = 64;  ///< per ray (A.3)
  int stencil = 9;   ///< pixels, of er and di in 6.24 (A.3)
};
void describe_keys(const Keys& keys, FieldRays& config);

/// Draws radiance fields around the surfaces of one character. Memory: the image and a group of rays for each thread
/// (FieldImageOptions).
class FieldViewer {
 public:
  /// @throws Error naming open edges when the template is not closed: an open mesh has no inside
  explicit FieldViewer(const Character& character);

  /// Draws every pixel whose ray comes near the mesh (6.24, with t_mi and t_ma of the field).
  /// @param projection float32 [3,4] pixels from world metres @param stencil of GuideOptions
  /// @throws Error when the camera is inside the mesh
  FieldImage draw(RadianceField& field, const FieldSurface& surface, const torch::Tensor& projection, int64_t height,
                  int64_t width, int stencil, const FieldImageOptions& options = {});

  /// The intervals in which rays are sampled, for several views. @param vertices float32 [N,3] @param projection
  /// float32 [V,3,4]
  GuideImages guide(const torch::Tensor& vertices, const torch::Tensor& projection, int64_t height, int64_t width,
                    const GuideOptions& options);

  const ClosestPoint& closest() const { return closest_; }
  const torch::Tensor& faces() const { return closest_->faces(); }  ///< int64 [F,3]

 private:
  ClosestPoint closest_;
  Rasterizer rasterizer_;
};

/// The options that guide rays around the mesh of a radiance field. @param stencil pixels
GuideOptions guide_of(const RadianceFieldConfig& field, int stencil);

}  // namespace doppel
