#pragma once

#include <torch/types.h>

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
/// which biases both sums; the outline does not. With `outline` distances are those of the image that was cropped,
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

}  // namespace doppel
