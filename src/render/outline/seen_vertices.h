#pragma once

#include <torch/types.h>

namespace doppel {

/// Vertices that face the camera and belong to a drawn face. The first condition is needed at a rim, where a surface
/// turns away: there drawn faces have corners on the other side, for example on the inside of a skirt.
/// @param face_id int32 [H,W] of a rasterizer, -1 background @param faces int64 [F,3]
/// @param vertices [N,3] as drawn @param eye [3] the camera's centre
/// @param min_facing smallest cosine between area-weighted normal and direction to the camera of a facing vertex
/// @return bool [N]
torch::Tensor seen_vertices(const torch::Tensor& face_id, const torch::Tensor& faces, const torch::Tensor& vertices,
                            const torch::Tensor& eye, double min_facing = 0.0);

}  // namespace doppel
