#include "doppel/nets/sagcn.h"

#include <ATen/Parallel.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/autograd.h>
#include <torch/optim/adam.h>
#include <torch/types.h>

#include <cstdlib>
#include <sstream>

#include "doppel/core/error.h"
#include "doppel/geometry/topology.h"
#include "support/gradient_check.h"
#include "support/message_of.h"

namespace doppel::sagcn_test {
namespace {

using ::testing::HasSubstr;
using torch::Tensor;

RingWeights ring_of(int nodes, int rings) {
  std::vector<std::array<int, 2>> edges;
  for (int i = 0; i + 1 < nodes; ++i) edges.push_back({i, i + 1});
  for (int i = 0; i + 3 < nodes; ++i) edges.push_back({i, i + 3});
  return RingWeights::from_topology(MeshTopology(nodes, edges), rings);
}

SagcnConfig small_config() {
  SagcnConfig config;
  config.features = 5;
  config.residual_blocks = 2;
  config.head_scale = 0.5;
  config.norm_momentum = 0.1;
  return config;
}

double largest(const Tensor& tensor) { return tensor.abs().max().item<double>(); }

TEST(SagcnAgrees, WithItsReferenceForEveryNormAndDenseBlock) {
  const RingWeights ring = ring_of(23, 3);
  torch::manual_seed(1);
  const Tensor features = torch::randn({4, 23, 7}), grad = torch::randn({4, 23, 3});
  for (const SagcnNorm norm : {SagcnNorm::node, SagcnNorm::channel, SagcnNorm::none})
    for (const DenseBlock dense : {DenseBlock::none, DenseBlock::broadcast, DenseBlock::matrix})
      for (const bool training : {true, false}) {
        SagcnConfig config = small_config();
        config.norm = norm;
        config.dense = dense;
        Sagcn fast(ring, 7, 3, config), plain(ring, 7, 3, config);
        plain->to(torch::kFloat64);
        fast->train(training);
        plain->train(training);
        const Tensor x = features.clone().requires_grad_(), y = features.to(torch::kFloat64).requires_grad_();
        const Tensor found = fast->forward(x), expected = plain->forward_reference(y);
        found.backward(grad);
        expected.backward(grad.to(torch::kFloat64));
        EXPECT_LT(largest(found - expected), 2e-5);
        EXPECT_LT(largest(x.grad() - y.grad()), 1e-4);
        const auto found_parameters = fast->named_parameters(), expected_parameters = plain->named_parameters();
        for (const auto& item : expected_parameters)
          EXPECT_LT(largest(found_parameters[item.key()].grad() - item.value().grad()),
                    1e-4 * (1.0 + largest(item.value().grad())))
              << item.key();
        for (const auto& item : plain->named_buffers())
          EXPECT_LT(largest(fast->named_buffers()[item.key()] - item.value()), 1e-5) << item.key();
      }
}

TEST(SagcnAgrees, BitForBitAtAnyNumberOfThreads) {
  const RingWeights ring = ring_of(301, 3);
  torch::manual_seed(1);
  const Tensor features = torch::randn({4, 301, 7});
  std::vector<Tensor> results;
  const int before = at::get_num_threads();
  for (const int threads : {1, 2, 3}) {
    at::set_num_threads(threads);
    Sagcn net(ring, 7, 3, small_config());
    const Tensor output = net->forward(features);
    output.square().sum().backward();
    results.push_back(
        torch::cat({output.detach().flatten(), net->named_parameters()["stem.kernels"].grad().flatten()}));
  }
  at::set_num_threads(before);
  EXPECT_TRUE(torch::equal(results[0], results[1]));
  EXPECT_TRUE(torch::equal(results[0], results[2]));
}

TEST(SagcnAgrees, WithItsReferenceOnOneSample) {
  const RingWeights ring = ring_of(211, 3);
  torch::manual_seed(1);
  const Tensor features = torch::randn({1, 211, 9}), grad = torch::randn({1, 211, 3});
  for (const int width : {16, 5}) {
    SagcnConfig config = small_config();
    config.features = width;
    config.norm = SagcnNorm::none;
    config.dense = DenseBlock::broadcast;
    Sagcn fast(ring, 9, 3, config), plain(ring, 9, 3, config);
    const Tensor found = fast->forward(features), expected = plain->forward_reference(features);
    found.backward(grad);
    expected.backward(grad);
    EXPECT_TRUE(test::is_near(found, expected, 1e-5, 1e-5));
    for (const auto& item : plain->named_parameters())
      EXPECT_TRUE(test::is_near(fast->named_parameters()[item.key()].grad(), item.value().grad(), 1e-4, 1e-4))
          << item.key();
  }
}

/// Random weights, and statistics that a training might have left.
void fill_at_random(SagcnImpl& net) {
  const torch::NoGradGuard no_grad;
  for (auto& item : net.named_parameters())
    item.value().uniform_(-0.3, 0.3).add_(item.key().find("norm.weight") == std::string::npos ? 0.0 : 1.0);
  for (auto& item : net.named_buffers())
    if (item.key().find("running_var") == std::string::npos)
      item.value().uniform_(-0.5, 0.5);
    else
      item.value().uniform_(0.5, 2.0);
}

void copy_into(torch::nn::Module& from, torch::nn::Module& to) {
  const torch::NoGradGuard no_grad;
  const auto parameters = from.named_parameters(), buffers = from.named_buffers();
  for (auto& item : to.named_parameters()) item.value().copy_(parameters[item.key()]);
  for (auto& item : to.named_buffers()) item.value().copy_(buffers[item.key()]);
}

/// Rounds what a frozen network holds in bfloat16: the kernels between the layers, 16 to 16 features.
void round_kernels(SagcnImpl& net) {
  const torch::NoGradGuard no_grad;
  for (auto& item : net.named_parameters())
    if (item.key().find("kernels") != std::string::npos && item.key().find("stem") == std::string::npos &&
        item.key().find("head") == std::string::npos)
      item.value().copy_(item.value().to(torch::kBFloat16));
}

TEST(FrozenSagcnAgrees, WithTheReferenceInEveryForm) {
  torch::manual_seed(1);
  for (const auto& [nodes, rings, blocks, outputs] :
       {std::tuple{23, 3, 2, 3}, {211, 4, 4, 16}, {64, 1, 0, 5}, {130, 2, 2, 1}})
    for (const SagcnNorm norm : {SagcnNorm::node, SagcnNorm::channel, SagcnNorm::none})
      for (const DenseBlock dense : {DenseBlock::none, DenseBlock::broadcast})
        for (const WeightFormat format : {WeightFormat::float32, WeightFormat::bfloat16}) {
          SagcnConfig config = small_config();
          config.features = 16;
          config.residual_blocks = blocks;
          config.norm = norm;
          config.dense = dense;
          const RingWeights ring = ring_of(nodes, rings);
          Sagcn frozen(ring, 9, outputs, config), plain(ring, 9, outputs, config);
          fill_at_random(*frozen);
          copy_into(*frozen, *plain);
          if (format == WeightFormat::bfloat16) round_kernels(*plain);
          plain->to(torch::kFloat64);
          plain->eval();
          frozen->eval();
          freeze_graph_networks(*frozen, format);
          const Tensor features = torch::randn({1, nodes, 9});
          const Tensor found = frozen->forward(features), expected = plain->forward(features.to(torch::kFloat64));
          EXPECT_FALSE(found.requires_grad());
          EXPECT_LT(largest(found - expected), 1e-5 * std::max(1.0, largest(expected)));
        }
}

TEST(FrozenSagcnAgrees, OnAGraphTooLargeForShortIndices) {
  SagcnConfig config = small_config();
  config.features = 16;
  config.norm = SagcnNorm::none;
  const int nodes = 66000;
  const RingWeights ring = ring_of(nodes, 2);
  Sagcn frozen(ring, 3, 3, config);
  frozen->eval();
  const torch::NoGradGuard no_grad;
  const Tensor features = torch::randn({1, nodes, 3}), expected = frozen->forward(features);
  frozen->freeze(WeightFormat::float32);
  EXPECT_LT(largest(frozen->forward(features) - expected), 1e-5);
}

TEST(FrozenSagcnAgrees, BitForBitAtAnyNumberOfThreadsAndOnlyWhereNothingIsTrained) {
  SagcnConfig config = small_config();
  config.features = 16;
  config.norm = SagcnNorm::none;
  config.dense = DenseBlock::broadcast;
  Sagcn net(ring_of(2000, 3), 7, 3, config);
  net->freeze(WeightFormat::bfloat16);
  const Tensor one = torch::randn({1, 2000, 7}), two = torch::randn({2, 2000, 7});
  EXPECT_TRUE(net->forward(one).requires_grad());  // training mode
  net->eval();
  EXPECT_TRUE(net->forward(two).requires_grad());
  EXPECT_TRUE(net->forward(one.clone().requires_grad_()).requires_grad());
  std::vector<Tensor> results;
  const int before = at::get_num_threads();
  for (const int threads : {1, 2, 3}) {
    at::set_num_threads(threads);
    results.push_back(net->forward(one));
  }
  at::set_num_threads(before);
  EXPECT_FALSE(results[0].requires_grad());
  EXPECT_TRUE(torch::equal(results[0], results[1]));
  EXPECT_TRUE(torch::equal(results[0], results[2]));
}

TEST(FrozenSagcnRejects, AnUnknownFormat) {
  setenv("DOPPEL_WEIGHTS", "int8", 1);
  EXPECT_THAT(support::message_of<UsageError>([&] { inference_weights(); }), HasSubstr("bfloat16"));
  setenv("DOPPEL_WEIGHTS", "bfloat16", 1);
  EXPECT_EQ(inference_weights(), WeightFormat::bfloat16);
  unsetenv("DOPPEL_WEIGHTS");
  EXPECT_EQ(inference_weights(), WeightFormat::float32);
}

TEST(DenseBroadcastAgrees, WithItsReferenceAtAnyNumberOfThreads) {
  auto generator = at::detail::createCPUGenerator(3);
  const int before = at::get_num_threads();
  for (const auto& [nodes, batch, width] : {std::tuple{200, 3, 7}, {64, 1, 16}, {1, 9, 1}, {130, 1, 33}, {70, 0, 4}}) {
    const auto random = [&](at::IntArrayRef shape) { return torch::randn(shape, generator, torch::kFloat32); };
    const Tensor features = random({nodes, batch, width}), kernels = random({nodes, width, width}),
                 bias = random({nodes, width}), grad = random({nodes, batch, width});
    std::vector<std::vector<Tensor>> results;
    const auto run = [&](torch::ScalarType type) {
      std::vector<Tensor> x;
      for (const Tensor& input : {features, kernels, bias}) x.push_back(input.to(type, false, true).requires_grad_());
      const Tensor output = elu_dense_broadcast_node_major(x[0], x[1], x[2], 0.3);
      std::vector<Tensor> result = torch::autograd::grad({output}, x, {grad.to(type)});
      result.push_back(output.detach());
      return result;
    };
    const auto expected = run(torch::kFloat64);
    for (const int threads : {1, 2, 3}) {
      at::set_num_threads(threads);
      results.push_back(run(torch::kFloat32));
      for (std::size_t i = 0; i < expected.size(); ++i) {
        EXPECT_TRUE(test::is_near(results.back()[i], expected[i], 2e-4, 1e-4)) << i << " nodes " << nodes;
        EXPECT_TRUE(torch::equal(results.back()[i], results.front()[i])) << i << " threads " << threads;
      }
    }
    at::set_num_threads(before);
  }
}

TEST(SagcnAgrees, OnAnEmptyBatch) {
  Sagcn net(ring_of(8, 2), 4, 3, small_config());
  EXPECT_EQ(net->forward(torch::zeros({0, 8, 4})).sizes(), (std::vector<int64_t>{0, 8, 3}));
}

TEST(SagcnGradient, MatchesCentralDifferences) {
  SagcnConfig config = small_config();
  config.features = 2;
  config.dense = DenseBlock::broadcast;
  Sagcn net(ring_of(6, 2), 2, 2, config);
  net->to(torch::kFloat64);
  torch::manual_seed(2);
  EXPECT_TRUE(test::gradients_match([&](const std::vector<Tensor>& x) { return net->forward(x[0]); },
                                    {{"features", torch::randn({3, 6, 2}, torch::kFloat64)}}));
}

TEST(SagcnReference, HasTheSizeOfThePublishedNetwork) {
  SagcnConfig config;
  Sagcn net(ring_of(10, 3), 18, 6, config);
  int64_t count = 0;
  for (const Tensor& parameter : net->parameters()) count += parameter.numel();
  // per node: stem 18*16+16, 16 SAGC of 16*16+16, 16 norms of 2*16, head 16*6+6
  EXPECT_EQ(count, 10 * (304 + 16 * 272 + 16 * 32 + 102));
}

TEST(SagcnReference, StartsNearZeroAndSameSeedGivesSameKernels) {
  const RingWeights ring = ring_of(30, 3);
  torch::manual_seed(4);
  const Tensor features = torch::randn({4, 30, 6});
  for (const SagcnInitialisation initialisation : {SagcnInitialisation::glorot, SagcnInitialisation::public_code}) {
    SagcnConfig config;
    config.initialisation = initialisation;
    Sagcn first(ring, 6, 6, config), second(ring, 6, 6, config);
    EXPECT_LT(largest(first->forward(features)), 0.05);
    EXPECT_GT(largest(first->forward(features)), 0.0);
    for (const auto& item : first->named_parameters())
      EXPECT_TRUE(torch::equal(item.value(), second->named_parameters()[item.key()])) << item.key();
    Sagcn other(ring, 6, 6, config, at::detail::createCPUGenerator(7));
    EXPECT_FALSE(torch::equal(first->named_parameters()["stem.kernels"], other->named_parameters()["stem.kernels"]));
  }
}

TEST(SagcnRecovers, AFunctionOfTheNeighbours) {
  const RingWeights ring = ring_of(20, 3);
  torch::manual_seed(6);
  const Tensor features = torch::randn({16, 20, 3});
  const Tensor target = (features + features.roll(1, 1)).sin();
  SagcnConfig config;
  config.norm = SagcnNorm::channel;
  Sagcn net(ring, 3, 3, config);
  torch::optim::Adam adam(net->parameters(), torch::optim::AdamOptions(5e-3));
  double first = 0.0, last = 0.0;
  for (int step = 0; step < 400; ++step) {
    adam.zero_grad();
    const Tensor loss = (net->forward(features) - target).square().mean();
    loss.backward();
    adam.step();
    last = loss.item<double>();
    if (step == 0) first = last;
  }
  // 16 samples of 20 nodes against 10,000 parameters: it must be able to learn them by heart.
  EXPECT_LT(last, 0.1 * first);
}

TEST(SagcnRejects, ABatchOfOneWithNormPerNode) {
  Sagcn net(ring_of(8, 2), 4, 3, small_config());
  EXPECT_THAT(support::message_of<Error>([&] { net->forward(torch::zeros({1, 8, 4})); }), HasSubstr("larger batch"));
  net->eval();
  EXPECT_EQ(net->forward(torch::zeros({1, 8, 4})).size(0), 1);
}

TEST(SagcnRejects, BadConfigurationsAllAtOnce) {
  SagcnConfig config;
  config.residual_blocks = 3;
  config.rings = 0;
  EXPECT_THAT(support::message_of<UsageError>([&] { config.check(); }),
              ::testing::AllOf(HasSubstr("residual_blocks must be even"), HasSubstr("rings must be at least 1")));
}

}  // namespace
}  // namespace doppel::sagcn_test
