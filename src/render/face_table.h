#pragma once

#include <torch/types.h>

#include <string>

#include "doppel/render/view_pass.h"

namespace doppel::render {

/// A tensor or its sizes as text for messages: `float [4,70,3,4] on cpu`, `[-1,3]`.
std::string describe(const torch::Tensor& t);
std::string describe_sizes(torch::IntArrayRef sizes);

/// @param faces int32 or int64 [F,3]; @param caller named in messages
/// @throws Error for another shape or type, or an index that is negative or beyond int32
FaceTable make_face_table(const torch::Tensor& faces, const char* caller);

/// @throws Error unless `t` is a float32 tensor on the CPU with these sizes (-1: any); the message describes `t`
void check_floats(const torch::Tensor& t, const char* caller, const char* name, torch::IntArrayRef sizes);

/// @throws Error unless 1 <= height, width <= kernels::kMaxImage
void check_image_size(std::int64_t height, std::int64_t width, const char* caller);

}  // namespace doppel::render
