#include "doppel/core/tensor/op.h"

#include <fmt/format.h>
#include <torch/csrc/autograd/functions/basic_ops.h>

namespace doppel {

torch::autograd::variable_list once_differentiable(torch::autograd::variable_list gradients, const char* op) {
  // Without create_graph these gradients cannot be differentiated again.
  if (!torch::GradMode::is_enabled()) return gradients;
  torch::autograd::variable_list defined;
  for (const auto& gradient : gradients) {
    if (gradient.defined()) defined.push_back(gradient.detach().requires_grad_());
  }
  auto trap = std::make_shared<torch::autograd::DelayedError>(
      fmt::format("{} has no second derivative; use its reference, which double tensors take", op),
      static_cast<int>(defined.size()));
  auto trapped = (*trap)(std::move(defined));
  size_t next = 0;
  for (auto& gradient : gradients) {
    if (gradient.defined()) gradient = trapped[next++];
  }
  return gradients;
}

}  // namespace doppel
