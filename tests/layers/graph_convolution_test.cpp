#include "doppel/layers/graph_convolution/graph_convolution.h"

#include <ATen/Parallel.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/autograd.h>
#include <torch/types.h>

#include "doppel/character/character.h"
#include "doppel/core/error.h"
#include "doppel/geometry/topology.h"
#include "support/gradient_check.h"
#include "support/message_of.h"
#include "support/shared_folder.h"

namespace doppel::graph_convolution_test {
namespace {

using support::message_of;
using ::testing::AllOf;
using ::testing::HasSubstr;
using torch::Tensor;

MeshTopology path_graph(int nodes) {
  std::vector<std::array<int, 2>> edges;
  for (int i = 0; i + 1 < nodes; ++i) edges.push_back({i, i + 1});
  return MeshTopology(nodes, edges);
}

/// A strip of triangles with one node of many neighbours and two components.
MeshTopology odd_graph(int nodes) {
  std::vector<std::array<int, 2>> edges;
  for (int i = 0; i + 2 < nodes - 3; ++i) {
    edges.push_back({i, i + 1});
    edges.push_back({i, i + 2});
  }
  for (int i = 7; i < nodes - 3; i += 3) edges.push_back({2, i});
  edges.push_back({nodes - 2, nodes - 1});
  return MeshTopology(nodes, edges);
}

struct Problem {
  Tensor features, kernels, bias;  // node-major
};

Problem random_problem(const RingWeights& ring, int64_t batch, int64_t inputs, int64_t outputs, at::ScalarType type) {
  torch::manual_seed(3);
  return {torch::randn({ring.num_nodes, batch, inputs}, type),
          torch::randn({ring.num_nodes, inputs, outputs}, type) * 0.3, torch::randn({ring.num_nodes, outputs}, type)};
}

NodeNorm random_norm(const RingWeights& ring, int64_t features, bool training, at::ScalarType type) {
  NodeNorm norm;
  norm.weight = torch::rand({ring.num_nodes, features}, type) + 0.5;
  norm.bias = torch::randn({ring.num_nodes, features}, type);
  norm.running_mean = torch::randn({ring.num_nodes, features}, type);
  norm.running_var = torch::rand({ring.num_nodes, features}, type) + 0.2;
  norm.training = training;
  norm.momentum = 0.1;
  return norm;
}

NodeNorm copy_of(const NodeNorm& norm, at::ScalarType type) {
  if (!norm.defined()) return norm;
  NodeNorm copy = norm;
  for (Tensor* tensor : {&copy.weight, &copy.bias, &copy.running_mean, &copy.running_var})
    *tensor = tensor->detach().to(type).clone();
  return copy;
}

/// Results and all gradients of one call, as doubles.
std::vector<Tensor> outcome(const Problem& problem, const NodeNorm& given_norm, const Tensor& skip,
                            const RingWeights& ring, at::ScalarType type, const Tensor& grad_output) {
  std::vector<Tensor> leaves;
  const auto leaf = [&](const Tensor& tensor) {
    leaves.push_back(tensor.detach().to(type).clone().set_requires_grad(true));
    return leaves.back();
  };
  NodeNorm norm = copy_of(given_norm, type);
  const Tensor features = leaf(problem.features), kernels = leaf(problem.kernels), bias = leaf(problem.bias);
  const Tensor skipped = skip.defined() ? leaf(skip) : Tensor();
  if (norm.defined()) {
    norm.weight = leaf(norm.weight);
    norm.bias = leaf(norm.bias);
  }
  const Tensor output = elu_graph_convolution_node_major(features, norm, kernels, bias, ring, skipped);
  std::vector<Tensor> results = torch::autograd::grad({output}, leaves, {grad_output.to(type)});
  results.push_back(output.detach());
  if (norm.defined()) {
    results.push_back(norm.running_mean);
    results.push_back(norm.running_var);
  }
  for (Tensor& result : results) result = result.to(torch::kFloat64);
  return results;
}

double relative_error(const Tensor& found, const Tensor& expected) {
  if (expected.numel() == 0) return found.sizes() == expected.sizes() ? 0.0 : 1.0;
  return ((found - expected).abs().max() / expected.abs().max().clamp_min(1.0)).item<double>();
}

class Threads {
 public:
  explicit Threads(int count) : before_(at::get_num_threads()) { at::set_num_threads(count); }
  ~Threads() { at::set_num_threads(before_); }

 private:
  int before_;
};

TEST(RingWeightsReference, FallLinearlyWithHopsAndLeaveOutTheLastRing) {
  const RingWeights ring = RingWeights::from_topology(path_graph(5), 3);
  // node 0 of a path: itself 3, next 2, the one after 1; the node at three hops has weight 0
  EXPECT_EQ(ring.num_entries, 3 + 4 + 5 + 4 + 3);
  EXPECT_TRUE(torch::allclose(ring.weights[0], torch::tensor({3.0, 2.0, 1.0, 0.0, 0.0}, torch::kFloat64) / 6.0));
  EXPECT_TRUE(torch::allclose(ring.weights.sum(1), torch::ones({5}, torch::kFloat64)));
}

TEST(RingWeightsReference, IsolatedNodesKeepThemselves) {
  const RingWeights ring = RingWeights::from_topology(MeshTopology(3, {}), 3);
  EXPECT_EQ(ring.num_entries, 3);
  EXPECT_TRUE(torch::equal(ring.weights, torch::ones({3, 1}, torch::kFloat64)));
}

TEST(GraphConvolutionReference, MixesNeighboursByHandMadeNumbers) {
  const RingWeights ring = RingWeights::from_topology(path_graph(3), 2);
  const Tensor features = torch::tensor({1.0, 2.0, 4.0}).view({1, 3, 1});
  const Tensor kernels = torch::tensor({10.0, 20.0, 30.0}).view({3, 1, 1});
  const Tensor bias = torch::tensor({0.5, 0.0, -0.5}).view({3, 1});
  // z = 10, 40, 120; rows (2,1)/3, (1,2,1)/4, (1,2)/3
  const Tensor expected = torch::tensor({20.0 + 0.5, 52.5, 280.0 / 3.0 - 0.5}).to(torch::kFloat32).view({1, 3, 1});
  EXPECT_TRUE(torch::allclose(graph_convolution_reference(features, kernels, bias, ring), expected));
  EXPECT_TRUE(torch::allclose(graph_convolution(features, kernels, bias, ring), expected));
}

TEST(GraphConvolutionReference, DenseBlocksAreOneSumAndOneMatrix) {
  torch::manual_seed(5);
  const Tensor features = torch::randn({2, 4, 3}), kernels = torch::randn({4, 3, 2}), bias = torch::randn({4, 2});
  const Tensor sum = torch::einsum("blh,lho->bo", {features, kernels});
  EXPECT_TRUE(
      torch::allclose(dense_broadcast(features, kernels, bias, 0.25), sum.unsqueeze(1) * 0.25 + bias, 1e-5, 1e-5));
  const Tensor matrix = torch::randn({4, 4}), wide = torch::randn({4, 3});
  EXPECT_TRUE(torch::allclose(dense_matrix(features, matrix, wide),
                              torch::einsum("kl,blh->bkh", {matrix, features}) + wide, 1e-5, 1e-5));
}

TEST(GraphConvolutionReference, EverySchemaIsRegistered) {
  auto& dispatcher = c10::Dispatcher::singleton();
  for (const char* name : {"doppel::graph_convolution", "doppel::graph_convolution_backward"})
    EXPECT_TRUE(dispatcher.findSchema({name, ""}).has_value()) << name;
}

struct Size {
  int64_t batch, inputs, outputs;
};

TEST(GraphConvolutionAgrees, WithTheReferenceAtOddSizesAndThreadCounts) {
  const RingWeights ring = RingWeights::from_topology(odd_graph(101), 3);
  for (const Size& n : {Size{1, 16, 16}, Size{3, 9, 16}, Size{8, 18, 16}, Size{8, 16, 6}, Size{5, 16, 3}, Size{2, 1, 1},
                        Size{17, 33, 20}, Size{0, 16, 16}}) {
    const Problem problem = random_problem(ring, n.batch, n.inputs, n.outputs, torch::kFloat64);
    const Tensor grad = torch::randn({ring.num_nodes, n.batch, n.outputs}, torch::kFloat64);
    for (const bool node_major : {true, false}) {
      std::vector<std::vector<Tensor>> all;
      for (const auto& [type, threads] :
           {std::pair{torch::kFloat64, 1}, {torch::kFloat32, 1}, {torch::kFloat32, 2}, {torch::kFloat32, 3}}) {
        const Threads use(threads);
        const auto leaf = [t = type](const Tensor& x) { return x.to(t).clone().set_requires_grad(true); };
        const Tensor f = leaf(node_major ? problem.features : problem.features.transpose(0, 1)),
                     k = leaf(problem.kernels), b = leaf(problem.bias);
        const Tensor out = node_major ? graph_convolution_node_major(f, k, b, ring) : graph_convolution(f, k, b, ring);
        auto results = torch::autograd::grad({out}, {f, k, b}, {(node_major ? grad : grad.transpose(0, 1)).to(type)});
        results.push_back(out.detach());
        all.push_back(results);
      }
      for (std::size_t i = 0; i < all[0].size(); ++i) {
        EXPECT_LT(relative_error(all[1][i].to(torch::kFloat64), all[0][i]), 5e-6)
            << "result " << i << " at B=" << n.batch << " " << n.inputs << "->" << n.outputs;
        EXPECT_TRUE(torch::equal(all[1][i], all[2][i])) << "2 threads, result " << i;
        EXPECT_TRUE(torch::equal(all[1][i], all[3][i])) << "3 threads, result " << i;
      }
    }
  }
}

TEST(EluGraphConvolutionAgrees, WithTheReferenceInEveryMode) {
  const RingWeights ring = RingWeights::from_topology(odd_graph(60), 2);
  for (const Size& n : {Size{4, 16, 16}, Size{3, 9, 6}, Size{8, 18, 16}, Size{2, 5, 3}, Size{0, 16, 16}})
    for (const int mode : {0, 1, 2}) {  // no norm, running statistics, batch statistics
      const Problem problem = random_problem(ring, n.batch, n.inputs, n.outputs, torch::kFloat64);
      const NodeNorm norm = mode == 0 ? NodeNorm() : random_norm(ring, n.inputs, mode == 2, torch::kFloat64);
      const Tensor grad = torch::randn({ring.num_nodes, n.batch, n.outputs}, torch::kFloat64);
      for (const bool with_skip : {false, true}) {
        const Tensor skip = with_skip ? torch::randn_like(grad) : Tensor();
        const auto expected = outcome(problem, norm, skip, ring, torch::kFloat64, grad);
        const Threads two(2);
        const auto found = outcome(problem, norm, skip, ring, torch::kFloat32, grad);
        for (std::size_t i = 0; i < expected.size(); ++i)
          // 2e-4: a batch of two divides by the small difference of two numbers
          EXPECT_LT(relative_error(found[i], expected[i]), n.batch > 2 ? 2e-5 : 2e-4)
              << "result " << i << " mode " << mode << " B=" << n.batch << " " << n.inputs << "->" << n.outputs;
      }
    }
}

TEST(EluGraphConvolutionAgrees, FarIntoTheTailsOfTheExponential) {
  const RingWeights ring = RingWeights::from_topology(MeshTopology(4, {}), 1);
  const Tensor features =
      torch::tensor({-200.0, -88.0, -20.0, -1.0, -1e-3, 0.0, 1e-3, 50.0}).to(torch::kFloat32).view({4, 2, 1});
  const Tensor kernels = torch::ones({4, 1, 1}), bias = torch::zeros({4, 1});
  const Tensor found = elu_graph_convolution_node_major(features, {}, kernels, bias, ring);
  EXPECT_TRUE(torch::allclose(found, torch::elu(features), 0.0, 2e-7)) << found;
}

TEST(GraphConvolutionGradient, OfTheReferenceMatchesCentralDifferences) {
  const RingWeights ring = RingWeights::from_topology(odd_graph(9), 3);
  const Problem problem = random_problem(ring, 3, 2, 3, torch::kFloat64);
  EXPECT_TRUE(test::gradients_match(
      [&](const std::vector<Tensor>& x) { return graph_convolution_node_major(x[0], x[1], x[2], ring); },
      {{"features", problem.features}, {"kernels", problem.kernels}, {"bias", problem.bias}}));
}

TEST(EluGraphConvolutionGradient, OfTheReferenceMatchesCentralDifferences) {
  const RingWeights ring = RingWeights::from_topology(odd_graph(9), 2);
  const Problem problem = random_problem(ring, 4, 2, 2, torch::kFloat64);
  const NodeNorm given = random_norm(ring, 2, true, torch::kFloat64);
  EXPECT_TRUE(test::gradients_match(
      [&](const std::vector<Tensor>& x) {
        NodeNorm norm = copy_of(given, torch::kFloat64);
        norm.weight = x[3];
        norm.bias = x[4];
        return elu_graph_convolution_node_major(x[0], norm, x[1], x[2], ring, x[5]);
      },
      {{"features", problem.features},
       {"kernels", problem.kernels},
       {"bias", problem.bias},
       {"norm.weight", given.weight},
       {"norm.bias", given.bias},
       {"skip", torch::randn({9, 4, 2}, torch::kFloat64)}}));
}

TEST(GraphConvolutionRejects, WrongShapesAndTypesByName) {
  const RingWeights ring = RingWeights::from_topology(path_graph(4), 2);
  const Tensor kernels = torch::zeros({4, 3, 2}), bias = torch::zeros({4, 2}), features = torch::zeros({2, 4, 3});
  EXPECT_THAT(message_of<Error>([&] {
                graph_convolution(torch::zeros({2, 5, 3}), kernels, bias, ring);
              }),
              AllOf(HasSubstr("features"), HasSubstr("[B,K,Hin]"), HasSubstr("[2,5,3]")));
  EXPECT_THAT(message_of<Error>([&] {
                graph_convolution(features, torch::zeros({4, 2, 2}), bias, ring);
              }),
              AllOf(HasSubstr("kernels"), HasSubstr("[4,2,2]")));
  EXPECT_THAT(message_of<Error>([&] { graph_convolution(features, kernels, torch::zeros({2}), ring); }),
              AllOf(HasSubstr("bias"), HasSubstr("[4,2]")));
  EXPECT_THAT(message_of<Error>([&] { graph_convolution(features, kernels.to(torch::kFloat64), bias, ring); }),
              AllOf(HasSubstr("kernels"), HasSubstr("float64")));
  EXPECT_THAT(message_of<Error>([&] { RingWeights::from_topology(path_graph(4), 0); }), HasSubstr("R = 0"));
}

TEST(GraphConvolutionRejects, BatchStatisticsOfOneSample) {
  const RingWeights ring = RingWeights::from_topology(path_graph(4), 2);
  const NodeNorm norm = random_norm(ring, 3, true, torch::kFloat32);
  EXPECT_THAT(message_of<Error>([&] {
                elu_graph_convolution_node_major(torch::zeros({4, 1, 3}), norm, torch::zeros({4, 3, 2}),
                                                 torch::zeros({4, 2}), ring);
              }),
              HasSubstr("more than one sample"));
}

TEST(GraphConvolutionRejects, SecondDerivativesThroughTheKernel) {
  const RingWeights ring = RingWeights::from_topology(path_graph(4), 2);
  const Tensor features = torch::randn({2, 4, 3}, torch::requires_grad());
  const Tensor output = graph_convolution(features, torch::randn({4, 3, 2}), torch::zeros({4, 2}), ring);
  const Tensor gradient = torch::autograd::grad({output.sum()}, {features}, {}, true, true)[0];
  EXPECT_THAT(message_of([&] { gradient.sum().backward(); }), HasSubstr("no second derivative"));
}

/// Independent outputs on the public example character.
class RealGraphConvolution : public support::SharedFolderTest {
 protected:
  void SetUp() override {
    SharedFolderTest::SetUp();
    if (!IsSkipped()) graph_ = load_character(character_file()).graph;
  }
  Tensor array(const std::string& name) const {
    const NpyArray data = oracle("gcn/" + name);
    return torch::tensor(data.as<double>(), torch::kFloat64).view(data.shape);
  }
  EmbeddedGraph graph_;
};

TEST_F(RealGraphConvolution, AdjacencyMatches) {
  const RingWeights ring = RingWeights::from_graph(graph_, 3);
  const Tensor pairs = array("adj_ring3_kl").to(torch::kInt64), values = array("adj_ring3_norm1_value_f64");
  ASSERT_EQ(ring.num_entries, values.numel());
  Tensor expected = torch::zeros({ring.num_nodes, ring.num_nodes}, torch::kFloat64);
  const Tensor by_row = pairs.size(0) == 2 && pairs.size(1) != 2 ? pairs.t() : pairs;
  expected.index_put_({by_row.select(1, 0), by_row.select(1, 1)}, values.flatten());
  const Tensor found = torch::zeros_like(expected).scatter_add_(1, ring.neighbours, ring.weights);
  EXPECT_LT((found - expected).abs().max().item<double>(), 1e-9);
}

TEST_F(RealGraphConvolution, OutputsMatch) {
  const Tensor kernels = array("op_kernel_f32"), bias = array("op_bias_f32");
  const Tensor raw = array("op_input_f32"), input = raw.dim() == 2 ? raw.unsqueeze(0) : raw;
  for (const int rings : {2, 3}) {
    const RingWeights ring = RingWeights::from_graph(graph_, rings);
    const Tensor expected =
        array("op_output_ring" + std::to_string(rings) + "_norm1_f64").view({input.size(0), ring.num_nodes, -1});
    for (const auto type : {torch::kFloat64, torch::kFloat32}) {
      const Tensor found =
          graph_convolution(input.to(type), kernels.to(type), bias.to(type).view({ring.num_nodes, -1}), ring);
      EXPECT_LT((found - expected).abs().max().item<double>(), 1e-5) << "R = " << rings << " " << type;
    }
  }
}

}  // namespace
}  // namespace doppel::graph_convolution_test
