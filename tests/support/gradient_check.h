#pragma once

/// One helper for every gradient test: autograd against central differences in double.

#include <gtest/gtest.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <functional>
#include <sstream>
#include <string>
#include <vector>

namespace doppel::test {

struct NamedTensor {
  std::string name;
  torch::Tensor value;  ///< float64
};

struct GradientOptions {
  double step = 1e-6;  ///< of the central difference
  double absolute = 1e-7, relative = 1e-6;
  int elements = 60;  ///< of each input, picked by a fixed seed; all if it has fewer
};

/// Whether the gradient of sum(r * f(inputs)), r fixed random numbers, agrees with central differences for every input.
/// The failure names the input, the element and both values of the worst one.
inline ::testing::AssertionResult gradients_match(
    const std::function<torch::Tensor(const std::vector<torch::Tensor>&)>& f, const std::vector<NamedTensor>& inputs,
    const GradientOptions& options = {}) {
  auto generator = at::detail::createCPUGenerator(17);
  std::vector<torch::Tensor> leaves;
  for (const auto& input : inputs) leaves.push_back(input.value.detach().clone().contiguous().requires_grad_());
  const torch::Tensor output = f(leaves);
  const torch::Tensor probe = torch::randn(output.sizes(), generator, torch::kFloat64);
  (output * probe).sum().backward();

  torch::NoGradGuard no_grad;
  double worst = 0.0;
  std::ostringstream message;
  for (size_t i = 0; i < leaves.size(); ++i) {
    const torch::Tensor gradient =
        leaves[i].grad().defined() ? leaves[i].grad().contiguous() : torch::zeros_like(leaves[i]);
    const int64_t count = leaves[i].numel();
    const torch::Tensor order = torch::randperm(count, generator);
    for (int64_t e = 0; e < std::min<int64_t>(count, options.elements); ++e) {
      const int64_t index = order[e].item<int64_t>();
      double* element = leaves[i].data_ptr<double>() + index;
      const double kept = *element;
      *element = kept + options.step;
      const double above = (f(leaves) * probe).sum().item<double>();
      *element = kept - options.step;
      const double below = (f(leaves) * probe).sum().item<double>();
      *element = kept;
      const double expected = (above - below) / (2.0 * options.step);
      const double found = gradient.data_ptr<double>()[index];
      const double excess = std::abs(found - expected) / (options.absolute + options.relative * std::abs(expected));
      if (!(excess <= std::max(worst, 1.0))) {
        worst = std::isfinite(excess) ? excess : std::numeric_limits<double>::max();
        message.str("");
        message << "gradient to " << inputs[i].name << " " << inputs[i].value.sizes() << " at flat index " << index
                << ": autograd " << found << ", central difference " << expected;
      }
    }
  }
  if (worst > 1.0) return ::testing::AssertionFailure() << message.str();
  return ::testing::AssertionSuccess();
}

/// Whether two tensors agree within absolute + relative * |expected|; the failure shows the largest excess and its
/// position.
inline ::testing::AssertionResult is_near(const torch::Tensor& found, const torch::Tensor& expected, double absolute,
                                          double relative = 0.0) {
  if (found.sizes() != expected.sizes()) {
    return ::testing::AssertionFailure() << "shape " << found.sizes() << ", expected " << expected.sizes();
  }
  if (found.numel() == 0) return ::testing::AssertionSuccess();
  const torch::Tensor a = found.detach().to(torch::kFloat64).flatten(),
                      b = expected.detach().to(torch::kFloat64).flatten();
  const torch::Tensor excess = (a - b).abs() / (absolute + relative * b.abs());
  if ((excess <= 1.0).all().item<bool>()) return ::testing::AssertionSuccess();
  const int64_t index = torch::nan_to_num(excess, 1e300).argmax().item<int64_t>();
  return ::testing::AssertionFailure() << "at flat index " << index << " of " << expected.sizes() << ": "
                                       << a[index].item<double>() << ", expected " << b[index].item<double>()
                                       << " (allowed " << absolute << " + " << relative << " relative)";
}

}  // namespace doppel::test
