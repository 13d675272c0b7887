#pragma once

#include <torch/torch.h>

namespace doppel {

/// Vertices that face a camera and have a face that is drawn. At a rim, where a surface turns away, drawn faces have
/// corners that belong to the other side: a hem's to the inside of the skirt.
/// @param face_id int32 [H,W] of a rasterizer, -1 background @param faces int64 [F,3]
/// @param vertices [N,3] as drawn @param eye [3] the camera's centre
/// @param min_facing cosine between area-weighted normal and look from which a vertex faces the camera
/// @return bool [N]
torch::Tensor seen_vertices(const torch::Tensor& face_id, const torch::Tensor& faces, const torch::Tensor& vertices,
                            const torch::Tensor& eye, double min_facing = 0.0);

}  // namespace doppel
