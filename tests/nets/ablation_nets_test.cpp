#include "doppel/nets/ablation_nets.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/types.h>
#include <torch/utils.h>

#include "doppel/core/error.h"
#include "doppel/nets/egnet.h"
#include "support/gradient_check.h"
#include "support/message_of.h"
#include "support/test_character.h"

namespace doppel::ablation_nets_test {
namespace {

using torch::Tensor;

double largest(const Tensor& tensor) { return tensor.abs().max().item<double>(); }

/// A path with chords, and one node without neighbours.
MeshTopology graph_of(int nodes) {
  std::vector<std::array<int, 2>> edges;
  for (int i = 0; i + 2 < nodes; ++i) edges.push_back({i, i + 1});
  for (int i = 0; i + 4 < nodes; ++i) edges.push_back({i, i + 3});
  return MeshTopology(nodes, edges);
}

Tensor dense_laplacian(const MeshTopology& topology) {
  const int64_t K = topology.num_vertices();
  Tensor adjacency = torch::zeros({K, K}, torch::kFloat64);
  for (int k = 0; k < K; ++k)
    for (const int l : topology.one_ring().row(k)) adjacency[k][l] = 1.0;
  const Tensor inverse_root = adjacency.sum(1).clamp_min(1.0).rsqrt();
  return -inverse_root.unsqueeze(1) * adjacency * inverse_root;
}

TEST(ChebyshevReference, IsThePolynomialOfTheRescaledLaplacian) {
  const MeshTopology topology = graph_of(11);
  const Tensor L = dense_laplacian(topology), eye = torch::eye(11, torch::kFloat64);
  auto generator = at::detail::createCPUGenerator(1);
  for (const int order : {1, 2, 3, 5}) {
    ChebyshevConvolution convolution(std::make_shared<const RescaledLaplacian>(topology), 4, 3, order);
    convolution->to(torch::kFloat64);
    {
      torch::NoGradGuard no_grad;
      for (Tensor& parameter : convolution->parameters()) parameter.normal_(0.0, 1.0, generator);
    }
    const Tensor x = torch::randn({2, 11, 4}, generator, torch::kFloat64);
    std::vector<Tensor> polynomials{eye, L};
    for (int m = 2; m < order; ++m) polynomials.push_back(2.0 * L.matmul(polynomials[m - 1]) - polynomials[m - 2]);
    Tensor expected = convolution->bias.expand({2, 11, 3});
    for (int m = 0; m < order; ++m) expected = expected + polynomials[m].matmul(x).matmul(convolution->weight[m]);
    EXPECT_TRUE(test::is_near(convolution->forward(x), expected, 1e-12)) << "order " << order;
  }
}

TEST(ChebyshevGradient, MatchesCentralDifferences) {
  SagcnConfig config;
  config.features = 3;
  config.residual_blocks = 2;
  config.norm = SagcnNorm::none;
  config.dense = DenseBlock::broadcast;
  config.head_scale = 0.5;
  auto generator = at::detail::createCPUGenerator(1);
  ChebyshevNetwork net(graph_of(9), 2, 3, config, 3, generator);
  net->to(torch::kFloat64);
  const Tensor features = torch::randn({2, 9, 2}, generator, torch::kFloat64);
  EXPECT_TRUE(test::gradients_match([&](const std::vector<Tensor>& x) { return net->forward(x[0]); },
                                    {{"features", features}}));
}

TEST(ChebyshevGradient, OfWeightsMatchesCentralDifferences) {
  auto generator = at::detail::createCPUGenerator(3);
  ChebyshevConvolution convolution(std::make_shared<const RescaledLaplacian>(graph_of(9)), 2, 3, 3);
  const auto random = [&](at::IntArrayRef shape) { return torch::randn(shape, generator, torch::kFloat64); };
  EXPECT_TRUE(test::gradients_match(
      [&](const std::vector<Tensor>& x) {
        convolution->weight = x[1];
        convolution->bias = x[2];
        return convolution->forward(x[0]);
      },
      {{"features", random({2, 9, 2})}, {"weight", random({3, 2, 3})}, {"bias", random({3})}}));
}

TEST(ChebyshevReference, SharesItsWeightsAmongAllNodes) {
  SagcnConfig config;
  config.norm = SagcnNorm::none;
  const auto count = [&](int nodes) {
    ChebyshevNetwork net(graph_of(nodes), 9, 3, config, 3, at::detail::createCPUGenerator(1));
    int64_t numbers = 0;
    for (const Tensor& parameter : net->parameters()) numbers += parameter.numel();
    return numbers;
  };
  EXPECT_EQ(count(20), count(200));
  EXPECT_EQ(count(20), (3 * 9 * 16 + 16) + 16 * (3 * 16 * 16 + 16) + (3 * 16 * 3 + 3));
}

TEST(FullyConnectedReference, IsAsDeepAsAsked) {
  AblationConfig config;
  FullyConnected net(30, 7, 3, config, 1e-3, at::detail::createCPUGenerator(1));
  EXPECT_EQ(net->children().size(), 19u);
  const Tensor out = net->forward(torch::randn({4, 1, 30}));
  EXPECT_EQ(out.sizes(), (std::vector<int64_t>{4, 7, 3}));
  EXPECT_LT(largest(out), 0.05);
  EXPECT_THROW(net->forward(torch::randn({4, 7, 30})), UsageError);
}

TEST(AblationRejects, BadSizesAllAtOnce) {
  AblationConfig config;
  config.chebyshev_order = 0;
  config.fully_connected_layers = 0;
  EXPECT_THAT(
      support::message_of<UsageError>([&] { config.check(); }),
      ::testing::AllOf(::testing::HasSubstr("chebyshev_order"), ::testing::HasSubstr("fully_connected_layers")));
}

TEST(EgNetAblation, TakesEveryNetwork) {
  const Character character = make_test_character();
  const Tensor rest = torch::tensor(at::ArrayRef<double>(character.rest_dofs), torch::kFloat32);
  const Tensor windows =
      rest + 0.3 * torch::randn({4, 3, character.num_dofs()}, at::detail::createCPUGenerator(2), torch::kFloat32);
  for (const NetworkKind kind : {NetworkKind::fully_connected, NetworkKind::chebyshev}) {
    EgNetConfig config;
    config.network = kind;
    config.sagcn.features = 8;
    config.sagcn.residual_blocks = 2;
    EgNet net(character, config);
    const Tensor input = net->network_input(windows);
    net->set_input_statistics(input.mean(0), input.std(0));
    const auto [A, T] = net->forward(windows);
    EXPECT_EQ(A.sizes(), (std::vector<int64_t>{4, character.num_nodes(), 3}));
    EXPECT_EQ(T.sizes(), A.sizes());
    EXPECT_LT(largest(A) + largest(T), 0.1);
    (A.sum() + T.sum()).backward();
    for (const auto& item : net->named_parameters()) EXPECT_TRUE(item.value().grad().defined()) << item.key();
  }
}

}  // namespace
}  // namespace doppel::ablation_nets_test
