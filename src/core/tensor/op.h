#pragma once

/// What the ops of the library `doppel` share: calls through the dispatcher, optional arguments, gradients.

#include <ATen/core/dispatch/Dispatcher.h>
#include <torch/autograd.h>
#include <torch/library.h>
#include <torch/types.h>

namespace doppel {

/// The op registered under `name`, with the type of its kernel. The search takes a lock: keep the result in a static
/// variable.
template <typename Signature>
c10::TypedOperatorHandle<Signature> find_op(const char* name) {
  return c10::Dispatcher::singleton().findSchemaOrThrow(name, "").typed<Signature>();
}

/// An optional argument of an op. `Function::apply` does not accept undefined tensors, so optional ones have this type.
using OptionalTensor = c10::optional<torch::Tensor>;
inline OptionalTensor optional_of(const torch::Tensor& tensor) {
  return tensor.defined() ? OptionalTensor(tensor) : c10::nullopt;
}

/// Gradients without a derivative of their own: differentiating them throws an error that names the op.
torch::autograd::variable_list once_differentiable(torch::autograd::variable_list gradients, const char* op);

}  // namespace doppel
