#pragma once

#include <torch/types.h>

namespace doppel {

/// The masks a mesh is compared with: one square crop of S x S pixels per batch item and camera.
struct SilhouetteTarget {
  torch::Tensor projection;       ///< [B,C,3,4], crop pixels from world metres
  torch::Tensor distance;         ///< [B,C,S,S], signed distance to the outline, crop pixels: + outside, - inside
  torch::Tensor pixel_scale;      ///< [B,C], image pixels per crop pixel (used with SilhouetteUnit::image_pixels only)
  torch::Tensor valid;            ///< bool [B,C]: cameras that see the person
  torch::Tensor contour;          ///< [P,2], centres (x,y) of the contour pixels, crop pixels
  torch::Tensor contour_offsets;  ///< int64 [B*C+1]: contour of (b,c) = rows offsets[b*C+c] .. offsets[b*C+c+1]
};

enum class SilhouetteUnit { crop_pixels, image_pixels };

struct SilhouetteOptions {
  double model_to_data = 1;     ///< weight of the first sum
  double data_to_model = 1;     ///< weight of the second sum
  double distance_scale = 255;  ///< crop pixels of model-to-data distance that make a residual of 1
  double contour_radius = 30;   ///< crop pixels: how far a contour pixel looks for a vertex; also its residual's unit
  /// Crop pixels that a boundary vertex should lie inside the outline: the drawn outline runs outside its vertices.
  double inset = 0;
  bool visible_only = false;  ///< boundary vertices pass a depth test (see boundary.h)
  /// Unit of the distance images; the published 8-bit images leave it open. image_pixels multiplies the distance by
  /// pixel_scale.
  SilhouetteUnit unit = SilhouetteUnit::crop_pixels;
};

/// Both sums, each with its weight, scalars. Both are >= 0.
struct SilhouetteLoss {
  torch::Tensor model_to_data;
  torch::Tensor data_to_model;
  torch::Tensor total() const { return model_to_data + data_to_model; }
};

/// Two-sided silhouette loss: boundary vertices are drawn to the outline of the mask, and each contour pixel draws the
/// nearest boundary vertex. Summed over vertices (contour pixels), mean over valid cameras of the batch; 0 without any.
///
/// Gradient: to `vertices` only; not through boundary set, normals, rho. Where rho is -1 (vertex inside the mask whose
/// normal looks away from the nearest outline) the sign of the *gradient* is turned, the value is not.
/// @param vertices float32 or float64 [B,N,3], world, metres
/// @param faces int32 or int64 [F,3]
/// float32 on the CPU takes the fused kernel (value and gradient in one pass), everything else, and a ReferenceScope,
/// the reference.
/// @throws Error for wrong shapes or types
/// Equation: 6.8
SilhouetteLoss silhouette_loss(const torch::Tensor& vertices, const torch::Tensor& faces,
                               const SilhouetteTarget& target, const SilhouetteOptions& options = {});

/// The same for a boundary set given by the caller, bool [B,C,N] (boundary_vertices).
SilhouetteLoss silhouette_loss(const torch::Tensor& vertices, const torch::Tensor& faces, const torch::Tensor& boundary,
                               const SilhouetteTarget& target, const SilhouetteOptions& options = {});

/// Area-weighted vertex normals of unit length [B,N,3]; zero for a vertex without area. No gradient. float32 or
/// float64.
torch::Tensor silhouette_normals(const torch::Tensor& vertices, const torch::Tensor& faces);

}  // namespace doppel
