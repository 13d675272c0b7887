#pragma once

#include <torch/types.h>

#include "doppel/render/raster/view_pass.h"

namespace doppel::render {

/// @param faces int32 or int64 [F,3]; @param caller named in messages
/// @throws Error for another shape or type, or an index that is negative or beyond int32
FaceTable make_face_table(const torch::Tensor& faces, const char* caller);

/// @throws UsageError if a face names a vertex that is not there
void check_corners(const char* caller, const FaceTable& faces, std::int64_t num_vertices);

/// @throws UsageError unless 1 <= height, width <= kernels::kMaxImage
void check_image_size(std::int64_t height, std::int64_t width, const char* caller);

/// The arguments of a drawing. @param vertices float32 [B,N,3] @param projection float32 [B,C,3,4]
/// @throws UsageError for another shape or type, size of the image, or vertex of a face
void check_drawing(const char* caller, const torch::Tensor& vertices, const torch::Tensor& projection,
                   const FaceTable& faces, std::int64_t height, std::int64_t width);

}  // namespace doppel::render
