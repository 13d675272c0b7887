#pragma once

/// Helpers that the ops of this module share: checks of shapes and types, and once-differentiable gradients.

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <torch/autograd.h>
#include <torch/types.h>

#include <initializer_list>

#include "doppel/core/error.h"

namespace doppel {

/// The type and shape of a tensor, for messages: `float32 [4,70,3,4]`.
inline std::string describe(const torch::Tensor& tensor) {
  if (!tensor.defined()) return "an undefined tensor";
  return fmt::format("{} [{}]", torch::toString(tensor.scalar_type()), fmt::join(tensor.sizes(), ","));
}

/// Fails unless `tensor` is a floating-point tensor of the given shape; -1 allows any size.
/// @param letters the documented shape, e.g. "[B,K,3]"
inline void check_shape(const char* op, const char* argument, const torch::Tensor& tensor,
                        std::initializer_list<int64_t> shape, const char* letters) {
  bool fits = tensor.defined() && tensor.is_floating_point() && tensor.dim() == static_cast<int64_t>(shape.size());
  if (fits) {
    int64_t axis = 0;
    for (int64_t size : shape) {
      fits = fits && (size < 0 || tensor.size(axis) == size);
      ++axis;
    }
  }
  if (!fits) {
    fail<UsageError>("{}: {} must be a floating-point tensor {} = [{}] (-1: any), found {}", op, argument, letters,
                     fmt::join(shape, ","), describe(tensor));
  }
}

/// Fails unless `tensor` has the type and device of `like`.
inline void check_same_kind(const char* op, const char* argument, const torch::Tensor& tensor,
                            const torch::Tensor& like) {
  if (tensor.scalar_type() != like.scalar_type() || tensor.device() != like.device()) {
    fail<UsageError>("{}: {} is {} on {}, the other arguments are {} on {}; convert it with .to()", op, argument,
                     torch::toString(tensor.scalar_type()), tensor.device().str(), torch::toString(like.scalar_type()),
                     like.device().str());
  }
}

/// An optional argument of an op. `Function::apply` does not accept undefined tensors, so optional ones have this type.
using OptionalTensor = c10::optional<torch::Tensor>;
inline OptionalTensor optional_of(const torch::Tensor& tensor) {
  return tensor.defined() ? OptionalTensor(tensor) : c10::nullopt;
}

/// Gradients without a derivative of their own: differentiating them throws an error that names the op.
torch::autograd::variable_list once_differentiable(torch::autograd::variable_list gradients, const char* op);

}  // namespace doppel
