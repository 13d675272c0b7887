#pragma once

#include <torch/types.h>

#include <cstdint>

namespace doppel {

/// The points of a mesh that are seen at the edge of its drawing: one for each covered pixel with an uncovered
/// neighbour (of four), what the surface shows at that pixel's centre. As a mask's contour pixels are chosen, so the
/// two can be compared without a bias. Views have different numbers of points; rows beyond are not `used` and name
/// vertex 0.
struct OutlinePoints {
  torch::Tensor corners;       ///< int64 [V,P,3], vertices of the face that is seen
  torch::Tensor barycentrics;  ///< float32 [V,P,3], perspective-correct; 0 where not used
  torch::Tensor used;          ///< bool [V,P]
};

/// Draws B meshes into C cameras each. Points in the image's outermost two pixels are left out: there the body may be
/// cut off. No gradient. The same bits with any number of threads.
/// @param vertices float32 [B,N,3], world, metres
/// @param projection float32 [B,C,3,4], pixels from world metres
/// @param faces int32 or int64 [F,3]
/// @param height,width pixels
/// @param valid bool [B,C], or undefined for all; an invalid view has no points
/// @return of V = B*C views
/// @throws Error for wrong shapes or types
OutlinePoints outline_points(const torch::Tensor& vertices, const torch::Tensor& projection, const torch::Tensor& faces,
                             std::int64_t height, std::int64_t width, const torch::Tensor& valid = {});

}  // namespace doppel
