#include "doppel/nets/shared_norm.h"

#include <torch/autograd.h>
#include <torch/nn/functional/batchnorm.h>

#include <algorithm>

namespace doppel {

using torch::Tensor;
using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

namespace {

/// [C] as factors of [B,C] or [B,C,H,W].
Tensor by_channel(const Tensor& values, const Tensor& x) { return x.dim() == 2 ? values : values.view({1, -1, 1, 1}); }

double values_of_a_channel(const Tensor& x) {
  return static_cast<double>(x.numel()) / static_cast<double>(std::max<std::int64_t>(x.size(1), 1));
}

struct Moments {
  Tensor mean, variance;  ///< float32 [C]
  double count = 0.0;     ///< values of a channel on all ranks
};

/// Sums in double: the difference of two large sums is the variance.
Moments moments_of_all_ranks(const Tensor& x, Ranks& ranks) {
  const std::int64_t C = x.size(1);
  const double count = values_of_a_channel(x);
  Tensor sums = torch::zeros({2 * C + 1}, torch::kFloat64);
  if (x.numel() > 0) {
    const auto [mean, variance] = at::batch_norm_update_stats(x, {}, {}, 0.0);
    const Tensor m = mean.to(torch::kFloat64), v = variance.to(torch::kFloat64);
    sums.narrow(0, 0, C).copy_(m * count);
    sums.narrow(0, C, C).copy_((v + m.square()) * count);
    sums[2 * C] = count;
  }
  ranks.sum(sums);
  const double all = sums[2 * C].item<double>();
  const Tensor mean = sums.narrow(0, 0, C) / all;
  const Tensor variance = (sums.narrow(0, C, C) / all - mean.square()).clamp_min(0.0);
  return {mean.to(torch::kFloat32), variance.to(torch::kFloat32), all};
}

class SharedBatchNorm : public torch::autograd::Function<SharedBatchNorm> {
 public:
  static Tensor forward(AutogradContext* context, const Tensor& x_in, const Tensor& weight, const Tensor& bias,
                        const Tensor& mean, const Tensor& variance, double count, double epsilon, Ranks* ranks) {
    const at::AutoDispatchBelowADInplaceOrView guard;
    const Tensor x = x_in.contiguous();
    context->save_for_backward({x, weight, mean, variance});
    context->saved_data["count"] = count;
    context->saved_data["epsilon"] = epsilon;
    context->saved_data["ranks"] = reinterpret_cast<std::int64_t>(ranks);
    return std::get<0>(at::native_batch_norm(x, weight, bias, mean, variance, false, 0.0, epsilon));
  }

  static variable_list backward(AutogradContext* context, variable_list upstream) {
    const variable_list saved = context->get_saved_variables();
    const Tensor &x = saved[0], &weight = saved[1], &mean = saved[2], &variance = saved[3];
    const double count = context->saved_data["count"].toDouble(), epsilon = context->saved_data["epsilon"].toDouble();
    auto* const ranks = reinterpret_cast<Ranks*>(context->saved_data["ranks"].toInt());
    const Tensor gradient = upstream[0].contiguous();
    const std::int64_t C = x.size(1);
    // Sums of g and of g (x - mu) / sigma over this rank's rows: the gradients to bias and weight.
    const auto [unused, to_weight, to_bias] = at::native_batch_norm_backward(gradient, x, weight, mean, variance, {},
                                                                             {}, false, epsilon, {false, true, true});
    const Tensor sums = at::cat({to_weight, to_bias}).to(torch::kFloat64);
    ranks->sum(sums);
    const Tensor inverse = (variance.to(torch::kFloat64) + epsilon).rsqrt();
    const Tensor along = sums.narrow(0, 0, C) / count * inverse, shift = sums.narrow(0, C, C) / count;
    // w / sigma (g - mean of g - (x - mu) / sigma * mean of g (x - mu) / sigma), as g a + x b + c
    const Tensor a = weight.to(torch::kFloat64) * inverse, b = -a * along, c = -a * (shift - along * mean);
    const auto factor = [&](const Tensor& values) { return by_channel(values.to(torch::kFloat32), x); };
    const Tensor to_x = (x * factor(b)).add_(factor(c)).add_(gradient * factor(a));
    return {to_x, to_weight, to_bias, Tensor(), Tensor(), Tensor(), Tensor(), Tensor()};
  }
};

}  // namespace

Tensor shared_batch_norm(const Tensor& x, const Tensor& weight, const Tensor& bias, const Tensor& running_mean,
                         const Tensor& running_var, double momentum, double epsilon, Ranks& ranks) {
  Moments moments;
  {
    const torch::NoGradGuard no_grad;
    moments = moments_of_all_ranks(x.detach().contiguous(), ranks);
    // The running variance is that of a sample, as in LibTorch.
    const double unbiased = moments.count / std::max(moments.count - 1.0, 1.0);
    running_mean.mul_(1.0 - momentum).add_(moments.mean, momentum);
    running_var.mul_(1.0 - momentum).add_(moments.variance, momentum * unbiased);
  }
  return SharedBatchNorm::apply(x, weight, bias, moments.mean, moments.variance, moments.count, epsilon, &ranks);
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

Tensor ImageNormImpl::forward(const Tensor& images) {
  if (is_training()) num_batches_tracked += 1;
  if (ranks() && is_training())
    return shared_batch_norm(images, weight, bias, running_mean, running_var, momentum_, epsilon_, *ranks());
  return torch::nn::functional::detail::batch_norm(images, running_mean, running_var, weight, bias, is_training(),
                                                   momentum_, epsilon_);
}

}  // namespace doppel
