#include "doppel/train/adam.h"

#include <ATen/Parallel.h>

#include <algorithm>
#include <cmath>

#include "doppel/actor/checkpoint.h"
#include "doppel/core/error.h"
#include "doppel/train/adam_kernel.h"

namespace doppel {

namespace {

/// Fixed, so that partial sums do not depend on the number of threads.
constexpr std::int64_t kChunk = 1 << 16;
/// Decays of the running means of the gradient and of its square.
constexpr double kBeta1 = 0.9, kBeta2 = 0.999;

/// Whether weight decay applies. Biases and the parameters of normalisation layers are exempt, because they shift and
/// scale outputs only. Parameters of one dimension are always of this kind (ResNet's `bn1`). Those of graph layers have
/// two dimensions and are recognised by name.
bool is_kernel(const std::string& name, const torch::Tensor& parameter) {
  return parameter.dim() >= 2 && name.find("bias") == std::string::npos && name.find("norm") == std::string::npos;
}

}  // namespace

void describe_keys(const Keys& keys, AdamOptions& o) {
  keys("weight_decay", o.weight_decay, at_least(0.0),
       "per step and unit of learning rate, as in AdamW; kernels only, not biases nor the scales of normalisation");
  keys("clip_norm", o.clip_norm, at_least(0.0), "largest norm of the whole gradient; 0: no clipping");
  keys("mean_weights", o.mean_decay, between(0.0, 0.999999),
       "decay of a running mean of the weights, which evaluation and export then use; 0: none");
}

Adam::Adam(const std::vector<Group>& groups, const AdamOptions& options) : options_(options) {
  for (const Group& group : groups) add(group);
}

Adam::Adam(const torch::nn::Module& module, const AdamOptions& options) : options_(options) {
  Group kernels, others;
  others.weight_decay_scale = 0.0;
  for (const auto& item : module.named_parameters())
    (is_kernel(item.key(), item.value()) ? kernels : others).parameters.emplace_back(item.key(), item.value());
  add(kernels);
  add(others);
}

void Adam::add(const Group& group) {
  for (const auto& [name, parameter] : group.parameters) {
    if (parameter.scalar_type() != torch::kFloat32 || !parameter.is_contiguous() || !parameter.device().is_cpu())
      fail("parameter {} cannot be optimised: Adam needs contiguous float32 tensors in main memory", name);
    if (!parameter.requires_grad()) continue;
    const auto zeros = [](const torch::Tensor& like) {
      return torch::zeros_like(like, torch::MemoryFormat::Contiguous).detach();
    };
    Slot slot{
        name, parameter, zeros(parameter), zeros(parameter), {}, group.learning_rate_scale, group.weight_decay_scale};
    if (options_.mean_decay > 0.0) slot.mean = parameter.detach().clone();
    for (std::int64_t begin = 0; begin < parameter.numel(); begin += kChunk)
      chunks_.push_back({slots_.size(), begin, std::min(begin + kChunk, parameter.numel())});
    slots_.push_back(std::move(slot));
  }
}

double Adam::gradient_norm() const {
  std::vector<torch::Tensor> gradients;
  for (const Slot& slot : slots_) {
    const torch::Tensor& gradient = slot.parameter.grad();
    gradients.push_back(gradient.defined() ? gradient.contiguous() : gradient);
  }
  std::vector<double> sums(chunks_.size(), 0.0);
  at::parallel_for(0, static_cast<std::int64_t>(chunks_.size()), 1, [&](std::int64_t first, std::int64_t last) {
    for (std::int64_t i = first; i < last; ++i) {
      const Chunk& chunk = chunks_[i];
      const torch::Tensor& gradient = gradients[chunk.slot];
      if (gradient.defined()) sums[i] = kernels::sum_of_squares(gradient.data_ptr<float>(), chunk.begin, chunk.end);
    }
  });
  double sum = 0.0;
  for (double part : sums) sum += part;
  return std::sqrt(sum);
}

std::optional<std::string> Adam::non_finite_gradient() const {
  for (const Slot& slot : slots_) {
    const torch::Tensor& gradient = slot.parameter.grad();
    if (gradient.defined() && !torch::isfinite(gradient).all().item<bool>()) return slot.name;
  }
  return std::nullopt;
}

void Adam::step(double learning_rate, double norm) {
  ++steps_;
  const double scale = options_.clip_norm > 0.0 && norm > options_.clip_norm ? options_.clip_norm / norm : 1.0;
  std::vector<kernels::AdamParams> params(slots_.size());
  std::vector<torch::Tensor> gradients(slots_.size());
  for (std::size_t i = 0; i < slots_.size(); ++i) {
    Slot& slot = slots_[i];
    if (!slot.parameter.grad().defined()) continue;
    gradients[i] = slot.parameter.grad().contiguous();
    const double t = static_cast<double>(++slot.steps);
    // The first steps use a plain average, so that the initial weights soon have no influence on the mean.
    const double mean_rate = std::max(1.0 - options_.mean_decay, 1.0 / t);
    const double rate = learning_rate * slot.learning_rate_scale;
    const double decay = options_.weight_decay * slot.weight_decay_scale;
    kernels::AdamParams& p = params[i];
    p.parameter = slot.parameter.data_ptr<float>();
    p.gradient = gradients[i].data_ptr<float>();
    p.first_moment = slot.first.data_ptr<float>();
    p.second_moment = slot.second.data_ptr<float>();
    p.mean = slot.mean.defined() ? slot.mean.data_ptr<float>() : nullptr;
    p.gradient_scale = static_cast<float>(scale);
    p.shrink = static_cast<float>(1.0 - rate * decay);
    p.beta1 = static_cast<float>(kBeta1);
    p.beta2 = static_cast<float>(kBeta2);
    p.keep1 = static_cast<float>(1.0 - kBeta1);
    p.keep2 = static_cast<float>(1.0 - kBeta2);
    p.step_size = static_cast<float>(rate / (1.0 - std::pow(kBeta1, t)));
    p.inverse_root = static_cast<float>(1.0 / std::sqrt(1.0 - std::pow(kBeta2, t)));
    p.epsilon = static_cast<float>(options_.epsilon);
    p.mean_rate = static_cast<float>(mean_rate);
  }
  at::parallel_for(0, static_cast<std::int64_t>(chunks_.size()), 1, [&](std::int64_t first, std::int64_t last) {
    for (std::int64_t i = first; i < last; ++i) {
      const Chunk& chunk = chunks_[i];
      if (gradients[chunk.slot].defined()) kernels::adam_step(params[chunk.slot], chunk.begin, chunk.end);
    }
  });
}

void Adam::zero_grad() {
  for (Slot& slot : slots_) slot.parameter.mutable_grad().reset();
}

std::vector<std::pair<std::string, torch::Tensor>> Adam::mean_weights() const {
  std::vector<std::pair<std::string, torch::Tensor>> means;
  for (const Slot& slot : slots_)
    if (slot.mean.defined()) means.emplace_back(slot.name, slot.mean);
  return means;
}

bool Adam::needs_moments(const Slot& slot, const IsTrained& is_trained) {
  return slot.steps > 0 && (!is_trained || is_trained(slot.name));
}

void Adam::save(Checkpoint& checkpoint, const IsTrained& is_trained) const {
  checkpoint.set_text("optimizer.steps", std::to_string(steps_));
  torch::Tensor steps = torch::empty({static_cast<std::int64_t>(slots_.size())}, torch::kInt64);
  for (std::size_t i = 0; i < slots_.size(); ++i) steps[static_cast<std::int64_t>(i)] = slots_[i].steps;
  checkpoint.set_tensor("optimizer.slot_steps", steps);
  for (const Slot& slot : slots_) {
    if (slot.mean.defined()) checkpoint.set_tensor("optimizer.mean." + slot.name, slot.mean);
    if (!needs_moments(slot, is_trained)) continue;
    checkpoint.set_tensor("optimizer.first." + slot.name, slot.first);
    checkpoint.set_tensor("optimizer.second." + slot.name, slot.second);
  }
}

void Adam::load(const Checkpoint& checkpoint, const IsTrained& is_trained) {
  steps_ = checkpoint.integer("optimizer.steps");
  const torch::Tensor steps = checkpoint.tensor("optimizer.slot_steps");
  for (std::size_t i = 0; i < slots_.size(); ++i) {
    Slot& slot = slots_[i];
    slot.steps = steps[static_cast<std::int64_t>(i)].item<std::int64_t>();
    if (slot.mean.defined()) checkpoint.copy_tensor("optimizer.mean." + slot.name, slot.mean);
    if (!needs_moments(slot, is_trained)) continue;  // they are 0, or never used
    checkpoint.copy_tensor("optimizer.first." + slot.name, slot.first);
    checkpoint.copy_tensor("optimizer.second." + slot.name, slot.second);
  }
}

}  // namespace doppel
