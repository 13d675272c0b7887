#include "doppel/train/adam.h"

#include <ATen/Parallel.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/nn/modules/batchnorm.h>
#include <torch/nn/modules/container/sequential.h>
#include <torch/nn/modules/conv.h>
#include <torch/nn/modules/linear.h>
#include <torch/optim/adam.h>
#include <torch/optim/adamw.h>

#include <limits>
#include <map>

#include "doppel/actor/checkpoint.h"
#include "doppel/core/error.h"
#include "support/message_of.h"

namespace doppel::adam_test {
namespace {

/// Parameters of odd sizes, one larger than a chunk of parallel work; equal for equal seeds.
struct Model : torch::nn::Module {
  explicit Model(std::uint64_t seed) {
    const auto generator = at::detail::createCPUGenerator(seed);
    for (const auto& [name, size] : std::vector<std::pair<std::string, int64_t>>{{"a", 3}, {"b", 70001}, {"c", 1}})
      register_parameter(name, torch::empty({size, 1}).normal_(0, 0.1, generator));
    register_parameter("unused", torch::ones({4}));
  }
};

/// The same made-up gradients for every optimiser under test.
void set_gradients(torch::nn::Module& model, std::uint64_t seed) {
  const auto generator = at::detail::createCPUGenerator(seed);
  for (auto& item : model.named_parameters())
    if (item.key() != "unused")
      item.value().mutable_grad() = torch::empty_like(item.value()).normal_(0, 1, generator) * 0.1;
}

template <typename Optimizer>
void expect_equal_path(Optimizer& theirs, torch::nn::Module& their_model, Adam& ours, torch::nn::Module& our_model) {
  for (int step = 0; step < 30; ++step) {
    set_gradients(their_model, 100 + step);
    set_gradients(our_model, 100 + step);
    theirs.step();
    ours.step(1e-2, ours.gradient_norm());
  }
  for (const auto& item : their_model.named_parameters()) {
    const auto mine = our_model.named_parameters()[item.key()];
    EXPECT_TRUE(torch::allclose(mine, item.value(), 1e-6, 1e-6)) << item.key();
  }
}

TEST(AdamAgrees, WithTorchAdam) {
  Model theirs(1), ours(1);
  torch::optim::Adam reference(theirs.parameters(), torch::optim::AdamOptions(1e-2).eps(1e-8));
  Adam adam(ours, {});
  expect_equal_path(reference, theirs, adam, ours);
}

TEST(AdamAgrees, WhereGradientsBeginLateAndPause) {
  Model theirs(1), ours(1);
  torch::optim::Adam reference(theirs.parameters(), torch::optim::AdamOptions(1e-2).eps(1e-8));
  Adam adam(ours, {});
  for (int step = 0; step < 60; ++step) {
    for (Model* model : {&theirs, &ours}) {
      set_gradients(*model, 100 + step);
      if (step > 40 && step % 3 == 0) model->named_parameters()["unused"].mutable_grad() = torch::full({4}, 0.2);
    }
    reference.step();
    adam.step(1e-2, adam.gradient_norm());
    if (step == 50) {  // across a checkpoint, too
      Checkpoint checkpoint;
      adam.save(checkpoint);
      adam = Adam(ours, {});
      adam.load(checkpoint);
    }
    adam.zero_grad();
    for (auto& parameter : theirs.parameters()) parameter.mutable_grad().reset();
  }
  for (const auto& item : theirs.named_parameters())
    EXPECT_TRUE(torch::allclose(ours.named_parameters()[item.key()], item.value(), 1e-6, 1e-6)) << item.key();
}

TEST(AdamAgrees, AcrossACheckpointThatHoldsTheMomentsOfWhatIsTrainedOn) {
  Model unbroken(1), stopped(1);
  Adam adam(unbroken, {}), first(stopped, {});
  const auto step = [](Model& model, Adam& optimiser, int i) {
    set_gradients(model, 100 + i);
    if (i >= 5) model.named_parameters()["a"].mutable_grad().reset();
    optimiser.step(1e-2, optimiser.gradient_norm());
  };
  for (int i = 0; i < 5; ++i) step(stopped, first, i);
  Checkpoint checkpoint;
  const Adam::IsTrained is_trained = [](const std::string& name) { return name != "a"; };
  first.save(checkpoint, is_trained);
  EXPECT_TRUE(checkpoint.has_tensor("optimizer.first.b") && checkpoint.has_tensor("optimizer.second.b"));
  EXPECT_FALSE(checkpoint.has_tensor("optimizer.first.a") || checkpoint.has_tensor("optimizer.second.a"));
  EXPECT_FALSE(checkpoint.has_tensor("optimizer.first.unused"));
  Adam second(stopped, {});
  EXPECT_THROW(second.load(checkpoint), Error);
  second.load(checkpoint, is_trained);
  for (int i = 0; i < 9; ++i) step(unbroken, adam, i);
  for (int i = 5; i < 9; ++i) step(stopped, second, i);
  for (const auto& item : unbroken.named_parameters())
    EXPECT_TRUE(torch::equal(stopped.named_parameters()[item.key()], item.value())) << item.key();
}

TEST(AdamAgrees, WithTorchAdamW) {
  Model theirs(3), ours(3);
  torch::optim::AdamW reference(theirs.parameters(), torch::optim::AdamWOptions(1e-2).weight_decay(0.1));
  AdamOptions options;
  options.weight_decay = 0.1;
  Adam adam(ours, options);
  expect_equal_path(reference, theirs, adam, ours);
}

TEST(AdamAgrees, AnyNumberOfThreadsGivesTheSameBits) {
  std::vector<torch::Tensor> results;
  std::vector<double> norms;
  const int before = at::get_num_threads();
  for (int threads : {1, 2, 3}) {
    at::set_num_threads(threads);
    Model model(4);
    Adam adam(model, {});
    for (int step = 0; step < 3; ++step) {
      set_gradients(model, step);
      norms.push_back(adam.gradient_norm());
      adam.step(1e-3, norms.back());
    }
    results.push_back(model.named_parameters()["b"].detach().clone());
  }
  at::set_num_threads(before);
  for (int i = 1; i < 3; ++i) {
    EXPECT_TRUE(torch::equal(results[0], results[i]));
    for (int step = 0; step < 3; ++step) EXPECT_EQ(norms[step], norms[3 * i + step]);
  }
}

TEST(AdamReference, FirstStepMovesByTheLearningRate) {
  // m / (1-b1) = g, v / (1-b2) = g^2, so the step is rate * g / |g| whatever the gradient's size.
  Model model(5);
  const auto before = model.named_parameters()["a"].detach().clone();
  Adam adam(model, {});
  model.named_parameters()["a"].mutable_grad() = torch::tensor({3.0f, -0.02f, 5e-3f}).view({3, 1});
  adam.step(0.25, adam.gradient_norm());
  const auto moved = model.named_parameters()["a"].detach() - before;
  EXPECT_TRUE(torch::allclose(moved.view(-1), torch::tensor({-0.25f, 0.25f, -0.25f}), 0, 1e-5));
}

TEST(AdamReference, ClippingScalesTheWholeGradient) {
  Model model(6), small(6);
  AdamOptions options;
  options.epsilon = 1.0;  // makes the step depend on the gradient's size
  AdamOptions clipped = options;
  clipped.clip_norm = 1.0;
  Adam with(model, clipped), without(small, options);
  model.named_parameters()["a"].mutable_grad() = torch::tensor({3.0f, 4.0f, 0.0f});
  small.named_parameters()["a"].mutable_grad() = torch::tensor({0.6f, 0.8f, 0.0f});
  EXPECT_DOUBLE_EQ(with.gradient_norm(), 5.0);
  with.step(0.1, with.gradient_norm());
  without.step(0.1, without.gradient_norm());
  EXPECT_TRUE(torch::allclose(model.named_parameters()["a"], small.named_parameters()["a"], 0, 1e-7));
}

TEST(AdamReference, MeanOfWeights) {
  Model model(7);
  AdamOptions options;
  options.mean_decay = 0.9;
  Adam adam(model, options);
  torch::Tensor mean;
  for (int step = 1; step <= 25; ++step) {
    set_gradients(model, step);
    adam.step(1e-2, 0.0);
    const auto now = model.named_parameters()["a"].detach().to(torch::kFloat64);
    const double rate = std::max(0.1, 1.0 / step);
    mean = step == 1 ? now.clone() : mean + rate * (now - mean);
  }
  for (const auto& [name, value] : adam.mean_weights())
    if (name == "a") {
      EXPECT_TRUE(torch::allclose(value.to(torch::kFloat64), mean, 0, 1e-6));
    }
}

TEST(AdamReference, ParameterWithoutGradientStays) {
  Model model(8);
  AdamOptions options;
  options.weight_decay = 0.5;
  Adam adam(model, options);
  set_gradients(model, 1);
  adam.step(0.1, 0.0);
  EXPECT_TRUE(torch::equal(model.named_parameters()["unused"], torch::ones({4})));
}

TEST(AdamRejects, NonFiniteGradientIsNamed) {
  for (float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    Model model(9);
    Adam adam(model, {});
    set_gradients(model, 1);
    EXPECT_FALSE(adam.non_finite_gradient());
    model.named_parameters()["b"].mutable_grad()[70000] = bad;
    EXPECT_FALSE(std::isfinite(adam.gradient_norm()));
    EXPECT_EQ(adam.non_finite_gradient().value(), "b");
  }
}

TEST(AdamDecays, KernelsAndNotBiases) {
  torch::nn::Linear model(3, 2);
  const torch::Tensor weight = model->weight.detach().clone(), bias = model->bias.detach().clone();
  AdamOptions options;
  options.weight_decay = 2.0;
  Adam adam(*model, options);
  model->weight.mutable_grad() = torch::zeros_like(weight);
  model->bias.mutable_grad() = torch::zeros_like(bias);
  adam.step(0.1, 0.0);
  EXPECT_TRUE(torch::allclose(model->weight, weight * 0.8));
  EXPECT_TRUE(torch::equal(model->bias, bias));
}

/// Two convolutions with normalisation behind them, as ResNet names them, and a graph's bias, which has two dimensions.
struct NormalisedModel : torch::nn::Module {
  NormalisedModel() {
    register_module("conv1", torch::nn::Conv2d(torch::nn::Conv2dOptions(1, 1, 1).bias(false)));
    register_module("bn1", torch::nn::BatchNorm2d(1));
    register_module("downsample",
                    torch::nn::Sequential(torch::nn::Conv2d(torch::nn::Conv2dOptions(1, 1, 1).bias(false)),
                                          torch::nn::BatchNorm2d(1)));
    register_parameter("graph_bias", torch::ones({2, 2}));
    register_parameter("graph_norm_weight", torch::ones({2, 2}));
  }
};

TEST(AdamDecays, NoScaleOfANormalisationUnderAnyName) {
  NormalisedModel model;
  std::map<std::string, torch::Tensor> before;
  for (auto& item : model.named_parameters()) {
    before[item.key()] = item.value().detach().clone();
    item.value().mutable_grad() = torch::zeros_like(item.value());
  }
  AdamOptions options;
  options.weight_decay = 2.0;
  Adam(model, options).step(0.1, 0.0);
  for (const auto& item : model.named_parameters()) {
    const bool decays = item.key() == "conv1.weight" || item.key() == "downsample.0.weight";
    EXPECT_TRUE(torch::allclose(item.value(), before[item.key()] * (decays ? 0.8 : 1.0))) << item.key();
  }
}

TEST(AdamRejects, DoubleParameters) {
  torch::nn::Module model;
  model.register_parameter("wide", torch::ones({2}, torch::kFloat64));
  EXPECT_THAT(support::message_of<Error>([&] { Adam(model, {}); }), ::testing::HasSubstr("wide"));
}

TEST(AdamRecovers, StateRoundTripsToTheBit) {
  Model model(10), copy(11);
  AdamOptions options;
  options.mean_decay = 0.99;
  Adam adam(model, options), restored(copy, options);
  for (int step = 0; step < 5; ++step) {
    set_gradients(model, step);
    adam.step(1e-2, 0.0);
  }
  Checkpoint checkpoint;
  adam.save(checkpoint);
  save_module(model, "model.", checkpoint);
  load_module(copy, "model.", checkpoint);
  restored.load(checkpoint);
  for (int step = 5; step < 9; ++step) {
    set_gradients(model, step);
    set_gradients(copy, step);
    adam.step(1e-2, 0.0);
    restored.step(1e-2, 0.0);
  }
  for (const auto& item : model.named_parameters())
    EXPECT_TRUE(torch::equal(item.value(), copy.named_parameters()[item.key()])) << item.key();
}

}  // namespace
}  // namespace doppel::adam_test
