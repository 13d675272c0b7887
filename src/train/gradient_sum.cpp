#include "doppel/train/gradient_sum.h"

#include <torch/csrc/autograd/function.h>
#include <torch/csrc/autograd/function_hook.h>
#include <torch/csrc/autograd/variable.h>

#include <algorithm>

namespace doppel {

namespace {

using torch::autograd::variable_list;

/// Calls a function after the gradient of a parameter is complete.
class AfterGradient : public torch::autograd::FunctionPostHook {
 public:
  explicit AfterGradient(std::function<void()> call) : call_(std::move(call)) {}
  variable_list operator()(const variable_list& outputs, const variable_list& /*inputs*/) override {
    call_();
    return outputs;
  }

 private:
  std::function<void()> call_;
};

}  // namespace

GradientSum::GradientSum(torch::nn::Module& module, Ranks* ranks, std::int64_t bucket_bytes) : ranks_(ranks) {
  if (!ranks_) return;
  std::vector<torch::Tensor> parameters = module.parameters();
  std::reverse(parameters.begin(), parameters.end());
  std::int64_t filled = bucket_bytes;
  for (const torch::Tensor& parameter : parameters) {
    if (!parameter.requires_grad()) continue;
    if (filled >= bucket_bytes) {
      buckets_.emplace_back();
      filled = 0;
    }
    Bucket& bucket = buckets_.back();
    bucket.offsets.push_back(filled / 4);
    bucket.parameters.push_back(parameter);
    filled += 4 * parameter.numel();
  }
  for (std::size_t i = 0; i < buckets_.size(); ++i) {
    Bucket& bucket = buckets_[i];
    const std::int64_t values = bucket.offsets.back() + bucket.parameters.back().numel();
    bucket.values = torch::zeros({values + static_cast<std::int64_t>(bucket.parameters.size())}, torch::kFloat32);
    for (const torch::Tensor& parameter : bucket.parameters) {
      const auto node = torch::autograd::impl::grad_accumulator(parameter);
      const std::uintptr_t hook = node->add_post_hook(std::make_unique<AfterGradient>([this, i] { note_ready(i); }));
      remove_hooks_.emplace_back([node, hook] { node->del_post_hook(hook); });
    }
  }
}

GradientSum::~GradientSum() {
  for (const auto& remove : remove_hooks_) remove();
}

void GradientSum::note_ready(std::size_t bucket) {
  ++buckets_[bucket].ready;
  while (sent_ < buckets_.size() && buckets_[sent_].ready >= buckets_[sent_].parameters.size()) send(buckets_[sent_++]);
}

void GradientSum::send(Bucket& bucket) {
  const torch::NoGradGuard no_grad;
  const auto count = static_cast<std::int64_t>(bucket.parameters.size());
  const std::int64_t flags = bucket.values.numel() - count;
  for (std::int64_t i = 0; i < count; ++i) {
    const torch::Tensor& parameter = bucket.parameters[static_cast<std::size_t>(i)];
    const torch::Tensor part =
        bucket.values.narrow(0, bucket.offsets[static_cast<std::size_t>(i)], parameter.numel()).view_as(parameter);
    if (parameter.grad().defined())
      part.copy_(parameter.grad());
    else
      part.zero_();
    bucket.values[flags + i] = parameter.grad().defined() ? 1.0f : 0.0f;
  }
  bucket.wait = ranks_->begin_sum(bucket.values);
}

void GradientSum::unpack(Bucket& bucket) {
  const auto count = static_cast<std::int64_t>(bucket.parameters.size());
  const std::int64_t flags = bucket.values.numel() - count;
  for (std::int64_t i = 0; i < count; ++i) {
    torch::Tensor& parameter = bucket.parameters[static_cast<std::size_t>(i)];
    if (bucket.values[flags + i].item<float>() == 0.0f) continue;
    parameter.mutable_grad() =
        bucket.values.narrow(0, bucket.offsets[static_cast<std::size_t>(i)], parameter.numel()).view_as(parameter);
  }
}

void GradientSum::finish() {
  if (!ranks_) return;
  while (sent_ < buckets_.size()) send(buckets_[sent_++]);
  for (Bucket& bucket : buckets_) {
    bucket.wait();
    bucket.wait = nullptr;
    bucket.ready = 0;
    unpack(bucket);
  }
  sent_ = 0;
}

}  // namespace doppel
