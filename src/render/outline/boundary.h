#pragma once

#include <torch/types.h>

#include <cstdint>

namespace doppel {

struct BoundaryOptions {
  bool visible_only = false;      ///< only vertices that the camera sees, by depth test
  float depth_tolerance = 0.02f;  ///< metres, for visible_only
  float z_near = 0.01f;           ///< metres
};

/// Boundary vertices: vertices near the outline of the drawn mesh, whose projection has an uncovered pixel in its 3x3
/// neighbourhood. Vertices that face away from the camera count too, unless `visible_only`. Vertices outside the image
/// or within one pixel of its border never count. No gradient.
///
/// @param vertices float32 [B,N,3], world, metres
/// @param projection float32 [B,C,3,4], crop pixels from world metres
/// @param faces int32 or int64 [F,3]
/// @param height,width of the crop, pixels
/// @param valid bool [B,C], or undefined for all; an invalid camera has no boundary vertices
/// @return bool [B,C,N]
/// @throws Error for wrong shapes or types
/// Section: 5.6.2, 6.5.4.1
torch::Tensor boundary_vertices(const torch::Tensor& vertices, const torch::Tensor& projection,
                                const torch::Tensor& faces, std::int64_t height, std::int64_t width,
                                const torch::Tensor& valid = {}, const BoundaryOptions& options = {});

}  // namespace doppel
