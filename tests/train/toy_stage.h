#pragma once

#include <fmt/format.h>
#include <torch/nn/modules/batchnorm.h>

#include <functional>
#include <random>
#include <sstream>

#include "doppel/train/stage.h"

namespace doppel::testing {

/// A small regression with everything a checkpoint must carry: parameters of several sizes, batch-norm buffers, dropout
/// from LibTorch's global generator, noise from the run's generator, and a data stream with a state.
struct ToyModelImpl : torch::nn::Module {
  ToyModelImpl() {
    const auto generator = at::detail::createCPUGenerator(7);
    const auto normal = [&](std::vector<int64_t> shape) { return torch::empty(shape).normal_(0.0, 0.3, generator); };
    first = register_parameter("first", normal({6, 32}));
    second = register_parameter("second", normal({32, 2}));
    bias = register_parameter("bias", normal({2}));
    norm = register_module("norm", torch::nn::BatchNorm1d(32));
    steps = register_buffer("steps", torch::zeros({1}, torch::kInt64));
  }
  torch::Tensor forward(const torch::Tensor& x) {
    if (is_training()) steps.add_(1);
    const auto hidden = torch::elu(norm(x.matmul(first)));
    return torch::dropout(hidden, 0.2, is_training()).matmul(second) + bias;
  }
  torch::Tensor first, second, bias, steps;
  torch::nn::BatchNorm1d norm{nullptr};
};
TORCH_MODULE(ToyModel);

class ToyStage : public Stage {
 public:
  std::string name() const override { return "toy"; }
  torch::nn::Module& model() override { return *model_; }
  ToyModelImpl& toy() { return *model_; }

  LossTerms loss(StepContext& context) override {
    torch::Tensor x;
    {
      ProfileScope scope(*context.profile, "load");
      x = torch::empty({16, 6});
      float* values = x.data_ptr<float>();
      std::uniform_real_distribution<float> uniform(-1.0f, 1.0f);
      first_frame_ = stream_() % 1000;
      for (int i = 0; i < 16 * 6; ++i) values[i] = uniform(stream_);
    }
    const auto target = torch::stack({x.select(1, 0) * x.select(1, 1), torch::sin(3.0 * x.select(1, 2))}, 1);
    const auto noise = torch::empty({16, 6}).normal_(0.0, 0.01, context.generator);
    const auto residual = model_(x + noise) - target;
    LossTerms terms = {{"fit", residual.square().mean(), 2.0}, {"size", model_->second.square().sum(), 1e-3}};
    if (spoil) spoil(context.step, terms);
    return terms;
  }
  std::string batch_description() const override { return fmt::format("frames {}", first_frame_); }
  std::string data_state() const override {
    std::ostringstream out;
    out << stream_;
    return out.str();
  }
  void restore_data(const std::string& state) override { std::istringstream(state) >> stream_; }
  std::string identity() const override { return identity_; }
  void prepare_evaluation() override { model_->norm->running_mean.fill_(42.0); }
  bool has_validation_frames() const override { return validation != nullptr; }
  std::optional<double> validation_loss(std::int64_t step) override {
    return validation ? validation(step) : std::nullopt;
  }
  std::vector<ReportImage> images() override {
    return {{"toy", "a grey square", cv::Mat(8, 8, CV_8UC3, cv::Scalar(128, 128, 128))}};
  }

  std::string identity_ = "toy data";
  std::function<void(std::int64_t, LossTerms&)> spoil;
  std::function<std::optional<double>(std::int64_t)> validation;

 private:
  ToyModel model_;
  std::mt19937_64 stream_{11};
  unsigned long first_frame_ = 0;
};

}  // namespace doppel::testing
