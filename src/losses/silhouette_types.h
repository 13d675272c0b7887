#pragma once

#include <torch/types.h>

namespace doppel {

/// The masks with which a mesh is compared: one square crop of S x S pixels per batch item and camera.
struct SilhouetteTarget {
  torch::Tensor projection;  ///< [B,C,3,4], crop pixels from world metres
  torch::Tensor distance;    ///< [B,C,S,S], signed distance to the outline, crop pixels: + outside, - inside
  /// [B,C], image pixels per crop pixel; used with SilhouetteUnit::image_pixels and SilhouetteBoundary::outline
  torch::Tensor pixel_scale;
  torch::Tensor valid;            ///< bool [B,C]: cameras that see the person
  torch::Tensor contour;          ///< [P,2], centres (x,y) of the contour pixels, crop pixels
  torch::Tensor contour_offsets;  ///< int64 [B*C+1]: contour of (b,c) = rows offsets[b*C+c] .. offsets[b*C+c+1]
};

/// The points of the mesh that are compared with the mask: its boundary vertices, as published, or all points of its
/// outline (OutlinePoints). Boundary vertices lie up to a pixel and a half inside the outline and some pixels apart,
/// which biases both sums. Outline points have no such bias. With `outline`, distances are in pixels of the image
/// before the crop, and the weight of a point is the width of its crop pixel in that image. The sums are then integrals
/// along the outline and do not depend on the resolution of the crop.
enum class SilhouetteBoundary { vertices, outline };

enum class SilhouetteUnit { crop_pixels, image_pixels };

struct SilhouetteOptions {
  double model_to_data = 1;     ///< weight of the first sum
  double data_to_model = 1;     ///< weight of the second sum
  double distance_scale = 255;  ///< crop pixels of model-to-data distance that make a residual of 1
  double contour_radius = 30;   ///< crop pixels: search radius of a contour pixel, and the unit of its residual
  /// Crop pixels by which a boundary vertex should lie inside the outline, because the drawn outline lies outside its
  /// vertices. Negative: outside.
  double inset = 0;
  SilhouetteBoundary boundary = SilhouetteBoundary::vertices;
  bool visible_only = false;  ///< boundary vertices must pass a depth test (see boundary.h)
  /// Unit of the distance images; the published 8-bit images leave it open. image_pixels multiplies the distance by
  /// pixel_scale.
  SilhouetteUnit unit = SilhouetteUnit::crop_pixels;
};

/// Both sums with their weights, scalars >= 0.
struct SilhouetteLoss {
  torch::Tensor model_to_data;
  torch::Tensor data_to_model;
  torch::Tensor total() const { return model_to_data + data_to_model; }
};

}  // namespace doppel
