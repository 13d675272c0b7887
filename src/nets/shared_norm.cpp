#include "doppel/nets/shared_norm.h"

#include <torch/autograd.h>
#include <torch/nn/functional/batchnorm.h>

#include <algorithm>
#include <utility>

namespace doppel {

using torch::Tensor;
using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

namespace {

using Rows = std::vector<std::int64_t>;

/// x as [outer, rows, inner]: the statistics are taken over the rows, which are neighbouring dimensions of x.
struct Layout {
  std::int64_t outer = 1, rows = 1, inner = 1;
};

Layout layout_of(const Tensor& x, const Rows& rows) {
  Layout layout;
  const auto count = static_cast<std::int64_t>(rows.size());
  for (std::int64_t i = 0; i < x.dim(); ++i)
    (i < rows.front() ? layout.outer : i < rows.front() + count ? layout.rows : layout.inner) *= x.size(i);
  return layout;
}

bool are_images(const Tensor& x) { return x.dim() == 4; }

/// Adds x and its squares over the rows. In double: the difference of two large sums is the variance.
/// @param sum, squares float64 [C...]
void sum_rows(const Tensor& x, const Layout& layout, const Tensor& sum, const Tensor& squares) {
  const float* const values = x.data_ptr<float>();
  double* const s = sum.data_ptr<double>();
  double* const q = squares.data_ptr<double>();
  const auto [outer, rows, inner] = layout;
  at::parallel_for(0, outer, 64, [=, rows = rows, inner = inner](std::int64_t begin, std::int64_t end) {
    for (std::int64_t row = begin * rows; row < end * rows; ++row) {
      const float* const from = values + row * inner;
      double* const to = s + row / rows * inner;
      double* const square = q + row / rows * inner;
      for (std::int64_t i = 0; i < inner; ++i) {
        const double value = from[i];
        to[i] += value;
        square[i] += value * value;
      }
    }
  });
}

/// x b + c. @param b, c float32 [C...]
Tensor line(const Tensor& x, const Rows& dimensions, const Tensor& b, const Tensor& c) {
  if (are_images(x)) return at::addcmul(c.view({1, -1, 1, 1}), x, b.view({1, -1, 1, 1}));
  Tensor out = torch::empty_like(x);
  const float* const values = x.data_ptr<float>();
  const float* const slope = b.data_ptr<float>();
  const float* const shift = c.data_ptr<float>();
  float* const to = out.data_ptr<float>();
  const auto [outer, rows, inner] = layout_of(x, dimensions);
  at::parallel_for(0, outer, 64, [=, rows = rows, inner = inner](std::int64_t begin, std::int64_t end) {
    for (std::int64_t row = begin * rows; row < end * rows; ++row) {
      const std::int64_t channel = row / rows * inner;
      for (std::int64_t i = 0; i < inner; ++i)
        to[row * inner + i] = values[row * inner + i] * slope[channel + i] + shift[channel + i];
    }
  });
  return out;
}

struct Moments {
  Tensor mean, variance;  ///< float64 [C...]
  double count = 0.0;     ///< values of a channel on all ranks
};

/// @param like a tensor [C...]
Moments moments_of_all_ranks(const Tensor& x, const Rows& rows, const Tensor& like, Ranks& ranks) {
  const std::int64_t C = like.numel();
  const double count = static_cast<double>(x.numel()) / static_cast<double>(std::max<std::int64_t>(C, 1));
  const Tensor sums = torch::zeros({2 * C + 1}, torch::kFloat64);
  const Tensor sum = sums.narrow(0, 0, C).view_as(like), squares = sums.narrow(0, C, C).view_as(like);
  if (x.numel() > 0 && are_images(x)) {
    const auto [mean, variance] = at::batch_norm_update_stats(x, {}, {}, 0.0);
    const Tensor m = mean.to(torch::kFloat64), v = variance.to(torch::kFloat64);
    sum.copy_(m * count);
    squares.copy_((v + m.square()) * count);
  } else {
    sum_rows(x, layout_of(x, rows), sum, squares);
  }
  sums[2 * C] = count;
  ranks.sum(sums);
  const double all = sums[2 * C].item<double>();
  const Tensor mean = sum / all;
  return {mean, (squares / all - mean.square()).clamp_min(0.0), all};
}

/// Passes weight and bias on. With the statistics as constants, a layer gives the gradient g w / sigma to x. This adds
/// the way through them,
///
///   -w / sigma (mean of g + (x - mu) / sigma * mean of g (x - mu) / sigma),
///
/// whose means are the gradients to bias and weight, summed over the ranks.
class ThroughStatistics : public torch::autograd::Function<ThroughStatistics> {
 public:
  static variable_list forward(AutogradContext* context, const Tensor& x, const Tensor& weight, const Tensor& bias,
                               const Moments& moments, double epsilon, const Rows& rows, Ranks* ranks) {
    context->save_for_backward({x, weight, moments.mean, (moments.variance + epsilon).rsqrt()});
    context->saved_data["count"] = moments.count;
    context->saved_data["rows"] = rows;
    context->saved_data["ranks"] = reinterpret_cast<std::int64_t>(ranks);
    return {weight.view_as(weight), bias.view_as(bias)};
  }

  static variable_list backward(AutogradContext* context, variable_list upstream) {
    const variable_list saved = context->get_saved_variables();
    const Tensor &x = saved[0], &weight = saved[1], &mean = saved[2], &inverse = saved[3];
    const double count = context->saved_data["count"].toDouble();
    auto* const ranks = reinterpret_cast<Ranks*>(context->saved_data["ranks"].toInt());
    const Tensor sums = at::stack({upstream[0], upstream[1]});
    ranks->sum(sums);
    // As x b + c.
    const Tensor along = sums[0].to(torch::kFloat64) / count * inverse, shift = sums[1].to(torch::kFloat64) / count;
    const Tensor b = -weight * inverse * along, c = -weight * inverse * (shift - along * mean);
    const Tensor to_x =
        line(x, context->saved_data["rows"].toIntVector(), b.to(torch::kFloat32), c.to(torch::kFloat32));
    return {to_x, upstream[0], upstream[1], Tensor(), Tensor(), Tensor(), Tensor()};
  }
};

}  // namespace

SharedStatistics share_statistics(const Tensor& x_in, const Rows& rows, const Tensor& weight, const Tensor& bias,
                                  const Tensor& running_mean, const Tensor& running_var, double momentum,
                                  double epsilon, Ranks& ranks) {
  const Tensor x = x_in.contiguous();
  Moments moments;
  {
    const torch::NoGradGuard no_grad;
    moments = moments_of_all_ranks(x.detach(), rows, weight, ranks);
    // The running variance is that of a sample, as in LibTorch.
    const double unbiased = moments.count / std::max(moments.count - 1.0, 1.0);
    running_mean.mul_(1.0 - momentum).add_(moments.mean, momentum);
    running_var.mul_(1.0 - momentum).add_(moments.variance, momentum * unbiased);
  }
  const variable_list passed = ThroughStatistics::apply(x, weight, bias, moments, epsilon, rows, &ranks);
  return {passed[0], passed[1], moments.mean.to(torch::kFloat32), moments.variance.to(torch::kFloat32)};
}

void share_batch_statistics(torch::nn::Module& network, Ranks* ranks) {
  for (const auto& module : network.modules())
    if (auto* const layer = dynamic_cast<BatchStatistics*>(module.get())) layer->share_among(ranks);
}

bool shares_batch_statistics(const torch::nn::Module& network) {
  for (const auto& module : network.modules(false))
    if (const auto* const layer = dynamic_cast<const BatchStatistics*>(module.get()); layer && layer->ranks())
      return true;
  return false;
}

ImageNormImpl::ImageNormImpl(std::int64_t channels, double epsilon, double momentum)
    : epsilon_(epsilon), momentum_(momentum) {
  weight = register_parameter("weight", torch::ones({channels}));
  bias = register_parameter("bias", torch::zeros({channels}));
  running_mean = register_buffer("running_mean", torch::zeros({channels}));
  running_var = register_buffer("running_var", torch::ones({channels}));
  num_batches_tracked = register_buffer("num_batches_tracked", torch::tensor(0, torch::kInt64));
}

ImageNormImpl::Affine ImageNormImpl::in_evaluation() const {
  const torch::Tensor scale = weight * (running_var + epsilon_).rsqrt();
  return {scale, bias - running_mean * scale};
}

Tensor ImageNormImpl::forward(const Tensor& images) {
  if (is_training()) num_batches_tracked += 1;
  if (ranks() && is_training()) {
    const SharedStatistics shared =
        share_statistics(images, {0, 2, 3}, weight, bias, running_mean, running_var, momentum_, epsilon_, *ranks());
    return at::batch_norm(images, shared.weight, shared.bias, shared.mean, shared.variance, false, 0.0, epsilon_,
                          false);
  }
  return torch::nn::functional::detail::batch_norm(images, running_mean, running_var, weight, bias, is_training(),
                                                   momentum_, epsilon_);
}

}  // namespace doppel
