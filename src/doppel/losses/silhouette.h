#pragma once

#include <torch/types.h>

#include "doppel/render/outline.h"

namespace doppel {

/// The masks a mesh is compared with: one square crop of S x S pixels per batch item and camera.
struct SilhouetteTarget {
  torch::Tensor projection;  ///< [B,C,3,4], crop pixels from world metres
  torch::Tensor distance;    ///< [B,C,S,S], signed distance to the outline, crop pixels: + outside, - inside
  /// [B,C], image pixels per crop pixel; used with SilhouetteUnit::image_pixels and SilhouetteBoundary::outline
  torch::Tensor pixel_scale;
  torch::Tensor valid;            ///< bool [B,C]: cameras that see the person
  torch::Tensor contour;          ///< [P,2], centres (x,y) of the contour pixels, crop pixels
  torch::Tensor contour_offsets;  ///< int64 [B*C+1]: contour of (b,c) = rows offsets[b*C+c] .. offsets[b*C+c+1]
};

/// What of the mesh is held against the mask: the vertices near the outline of its drawing, as published, or the
/// outline itself, pixel by pixel (OutlinePoints). Vertices lie up to a pixel and a half inside and some pixels apart,
/// which biases both sums; the outline does not. With `outline` distances are those of the picture that was cropped,
/// and a point counts as much as its pixel is wide there: sums become integrals along the outline, whatever the size of
/// the crop.
enum class SilhouetteBoundary { vertices, outline };

enum class SilhouetteUnit { crop_pixels, image_pixels };

struct SilhouetteOptions {
  double model_to_data = 1;     ///< weight of the first sum
  double data_to_model = 1;     ///< weight of the second sum
  double distance_scale = 255;  ///< crop pixels of model-to-data distance that make a residual of 1
  double contour_radius = 30;   ///< crop pixels: how far a contour pixel looks for a vertex; also its residual's unit
  /// Crop pixels that a boundary vertex should lie inside the outline: the drawn outline runs outside its vertices.
  /// Negative: outside.
  double inset = 0;
  SilhouetteBoundary boundary = SilhouetteBoundary::vertices;
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

/// The same for the points of an outline, drawn at the size of the distance images: both sums run over them instead of
/// boundary vertices, and their gradients go to the corners of the faces that are seen there.
SilhouetteLoss silhouette_loss(const torch::Tensor& vertices, const torch::Tensor& faces, const OutlinePoints& outline,
                               const SilhouetteTarget& target, const SilhouetteOptions& options = {});

/// Area-weighted vertex normals of unit length [B,N,3]; zero for a vertex without area. No gradient. float32 or
/// float64.
torch::Tensor silhouette_normals(const torch::Tensor& vertices, const torch::Tensor& faces);

}  // namespace doppel
