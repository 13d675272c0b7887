#pragma once

/// Checks of tensors that are arguments, with messages that say what was found and what is allowed. In shapes, -1
/// allows any size.

#include <torch/types.h>

#include <string>

namespace doppel {

/// A tensor for messages: `float32 [4,70,3,4]`; the device follows when it is not the CPU.
std::string describe(const torch::Tensor& tensor);
/// The name of a type for messages: `float32`.
std::string name_of(torch::ScalarType type);

/// Fails unless `tensor` has one of the types and the shape.
/// @param letters the documented shape, e.g. "[B,K,3]"; "": none
void check_tensor(const char* op, const char* argument, const torch::Tensor& tensor,
                  at::ArrayRef<torch::ScalarType> types, torch::IntArrayRef shape, const char* letters = "");

/// Fails unless `tensor` is a floating-point tensor of the shape.
void check_shape(const char* op, const char* argument, const torch::Tensor& tensor, torch::IntArrayRef shape,
                 const char* letters);

/// Fails unless `tensor` is a float32 tensor of the shape on the CPU.
void check_floats(const char* op, const char* argument, const torch::Tensor& tensor, torch::IntArrayRef shape,
                  const char* letters = "");

/// Fails unless `tensor` has the type and device of `like`.
void check_same_kind(const char* op, const char* argument, const torch::Tensor& tensor, const torch::Tensor& like);

}  // namespace doppel
