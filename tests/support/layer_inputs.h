#pragma once

#include <torch/autograd.h>
#include <torch/types.h>

#include <vector>

/// Seeded inputs for the tests of layers, and helpers to run them at several thread counts and to differentiate them.
namespace doppel::test {

inline torch::Tensor random_numbers(std::vector<int64_t> shape, uint64_t seed) {
  return torch::randn(shape, at::detail::createCPUGenerator(seed), torch::kFloat64);
}

/// Rigid transforms [B,n,3,4] with any rotation and translations of about `reach` metres.
inline torch::Tensor random_transforms(int64_t batch, int64_t n, double reach, uint64_t seed) {
  torch::Tensor q = random_numbers({batch, n, 4}, seed);
  q = q / q.norm(2, {-1}, true);
  const auto w = q.select(-1, 0), x = q.select(-1, 1), y = q.select(-1, 2), z = q.select(-1, 3);
  const auto t = reach * random_numbers({batch, n, 3}, seed + 1);
  const auto row = [](const torch::Tensor& a, const torch::Tensor& b, const torch::Tensor& c, const torch::Tensor& d) {
    return torch::stack({a, b, c, d}, -1);
  };
  return torch::stack({row(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), t.select(-1, 0)),
                       row(2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x), t.select(-1, 1)),
                       row(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y), t.select(-1, 2))},
                      -2);
}

/// Sets the number of threads and puts the old one back.
class ThreadScope {
 public:
  explicit ThreadScope(int threads) : before_(at::get_num_threads()) { at::set_num_threads(threads); }
  ~ThreadScope() { at::set_num_threads(before_); }

 private:
  int before_;
};

/// Gradients of sum(probe * output) to the inputs; undefined ones read as zeros.
inline std::vector<torch::Tensor> gradients_of(const torch::Tensor& output, const torch::Tensor& probe,
                                               const std::vector<torch::Tensor>& inputs) {
  auto gradients = torch::autograd::grad({output}, inputs, {probe.to(output.scalar_type())}, /*retain_graph=*/false,
                                         /*create_graph=*/false, /*allow_unused=*/true);
  for (size_t i = 0; i < gradients.size(); ++i) {
    if (!gradients[i].defined()) gradients[i] = torch::zeros_like(inputs[i]);
  }
  return gradients;
}

inline torch::Tensor leaf(const torch::Tensor& value, torch::ScalarType type) {
  return value.detach().to(type, /*non_blocking=*/false, /*copy=*/true).requires_grad_();
}

}  // namespace doppel::test
