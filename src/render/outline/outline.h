#pragma once

#include <torch/types.h>

#include <cstdint>

namespace doppel {

/// The surface points on the outline of a drawn mesh: one point for each covered pixel with an uncovered neighbour (of
/// four), at the pixel's centre. The contour pixels of a mask are chosen by the same rule, so a comparison of both has
/// no bias. Views have different numbers of points. Surplus rows are not `used` and refer to vertex 0.
struct OutlinePoints {
  torch::Tensor corners;       ///< int64 [V,P,3], vertices of the face that is seen
  torch::Tensor barycentrics;  ///< float32 [V,P,3], perspective-correct; 0 where not used
  torch::Tensor used;          ///< bool [V,P]
};

/// Draws B meshes into C cameras each. Points in the outermost two pixels of the image are left out, because the body
/// may be cut off there. No gradient. The result has the same bits for any number of threads.
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
