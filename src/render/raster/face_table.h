#pragma once

#include <torch/types.h>

#include "doppel/render/raster/view_pass.h"

namespace doppel::render {

/// @param faces int32 or int64 [F,3]; @param caller named in messages
/// @throws Error for another shape or type, or an index that is negative or beyond int32
FaceTable make_face_table(const torch::Tensor& faces, const char* caller);

/// @throws Error unless 1 <= height, width <= kernels::kMaxImage
void check_image_size(std::int64_t height, std::int64_t width, const char* caller);

}  // namespace doppel::render
