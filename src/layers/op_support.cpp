#include "doppel/layers/op_support.h"

#include <fmt/ranges.h>
#include <torch/csrc/autograd/functions/basic_ops.h>

namespace doppel {

std::string describe(const torch::Tensor& tensor) {
  if (!tensor.defined()) return "an undefined tensor";
  return fmt::format("{} [{}]", torch::toString(tensor.scalar_type()), fmt::join(tensor.sizes(), ","));
}

void check_shape(const char* op, const char* argument, const torch::Tensor& tensor,
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

void check_same_kind(const char* op, const char* argument, const torch::Tensor& tensor, const torch::Tensor& like) {
  if (tensor.scalar_type() != like.scalar_type() || tensor.device() != like.device()) {
    fail<UsageError>("{}: {} is {} on {}, the other arguments are {} on {}; convert it with .to()", op, argument,
                     torch::toString(tensor.scalar_type()), tensor.device().str(), torch::toString(like.scalar_type()),
                     like.device().str());
  }
}

torch::autograd::variable_list once_differentiable(torch::autograd::variable_list gradients, const char* op) {
  // Without create_graph these gradients cannot be differentiated again.
  if (!torch::GradMode::is_enabled()) return gradients;
  torch::autograd::variable_list defined;
  for (const auto& gradient : gradients) {
    if (gradient.defined()) defined.push_back(gradient.detach().requires_grad_());
  }
  auto trap = std::make_shared<torch::autograd::DelayedError>(
      fmt::format("{} has no second derivative; use its _reference form (double tensors or a ReferenceScope)", op),
      static_cast<int>(defined.size()));
  auto trapped = (*trap)(std::move(defined));
  size_t next = 0;
  for (auto& gradient : gradients) {
    if (gradient.defined()) gradient = trapped[next++];
  }
  return gradients;
}

}  // namespace doppel
