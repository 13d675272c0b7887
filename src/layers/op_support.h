#pragma once

/// Helpers that the ops of this module share: checks of shapes and types, and once-differentiable gradients.

#include <torch/autograd.h>
#include <torch/types.h>

#include <initializer_list>
#include <string>

#include "doppel/core/error.h"

namespace doppel {

/// The type and shape of a tensor, for messages: `float32 [4,70,3,4]`.
std::string describe(const torch::Tensor& tensor);

/// Fails unless `tensor` is a floating-point tensor of the given shape; -1 allows any size.
/// @param letters the documented shape, e.g. "[B,K,3]"
void check_shape(const char* op, const char* argument, const torch::Tensor& tensor,
                 std::initializer_list<int64_t> shape, const char* letters);

/// Fails unless `tensor` has the type and device of `like`.
void check_same_kind(const char* op, const char* argument, const torch::Tensor& tensor, const torch::Tensor& like);

/// An optional argument of an op. `Function::apply` does not accept undefined tensors, so optional ones have this type.
using OptionalTensor = c10::optional<torch::Tensor>;
inline OptionalTensor optional_of(const torch::Tensor& tensor) {
  return tensor.defined() ? OptionalTensor(tensor) : c10::nullopt;
}

/// Gradients without a derivative of their own: differentiating them throws an error that names the op.
torch::autograd::variable_list once_differentiable(torch::autograd::variable_list gradients, const char* op);

}  // namespace doppel
