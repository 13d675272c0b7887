#include "doppel/losses/arap.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "doppel/layers/embedded_deformation/embedded_deformation.h"
#include "support/gradient_check.h"
#include "support/message_of.h"
#include "support/test_character.h"

namespace doppel::arap_test {
namespace {

using support::message_of;
using namespace test;
using torch::Tensor;

const Character& actor() {
  static const Character character = make_test_character(5, 7, 17);
  return character;
}

Tensor numbers(int64_t batch, uint64_t seed) {
  return 0.3 * torch::randn({batch, actor().num_nodes(), 3}, at::detail::createCPUGenerator(seed), torch::kFloat64);
}

TEST(ArapReference, OneEdgeByHand) {
  // Node 0 at the origin, node 1 at (1,0,0), rigidities 2 and 4, so u = 3. Node 0 turns by 90 degrees about z and node
  // 1 moves by (0.1,0.2,0.3): residuals (0,1,0) - (1,0,0) - T_1 and (for the other direction) T_1.
  const ArapGraph graph({{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0}}, {{0, 1}}, {2.0, 4.0});
  const Tensor A = torch::tensor({{{0.0, 0.0, M_PI / 2}, {0.0, 0.0, 0.0}}}, torch::kFloat64);
  const Tensor T = torch::tensor({{{0.0, 0.0, 0.0}, {0.1, 0.2, 0.3}}}, torch::kFloat64);
  const double expected = 3.0 * ((1.1 + 0.8 + 0.3) + 0.6) / 2.0;
  EXPECT_NEAR(arap_loss(A, T, graph).item<double>(), expected, 1e-12);
  EXPECT_NEAR(arap_loss(A.to(torch::kFloat32), T.to(torch::kFloat32), graph).item<double>(), expected, 1e-6);
}

TEST(ArapReference, RigidMotionsCostNothing) {
  const ArapGraph graph(actor());
  const Tensor angles = torch::tensor({0.3, -0.4, 1.0}, torch::kFloat64);
  const Tensor R = euler_to_matrix(angles);
  Tensor nodes = torch::empty({actor().num_nodes(), 3}, torch::kFloat64);
  for (int k = 0; k < actor().num_nodes(); ++k) {
    for (int c = 0; c < 3; ++c) nodes[k][c] = actor().mesh.vertices[actor().graph.node_vertex[k]][c];
  }
  const Tensor T = (torch::matmul(nodes, R.t()) - nodes + 0.5).unsqueeze(0);
  const Tensor A = angles.expand_as(T).contiguous();
  EXPECT_NEAR(arap_loss(A, T, graph).item<double>(), 0.0, 1e-12);
  EXPECT_GT(arap_loss(2.0 * A, T, graph).item<double>(), 1e-2);
}

TEST(ArapReference, AtRestValueAndSubgradientAreZero) {
  const ArapGraph graph(actor());
  for (auto type : {torch::kFloat32, torch::kFloat64}) {
    const Tensor A = torch::zeros({2, actor().num_nodes(), 3}, type).requires_grad_();
    const Tensor T = torch::zeros({2, actor().num_nodes(), 3}, type).requires_grad_();
    const Tensor loss = arap_loss(A, T, graph);
    loss.backward();
    EXPECT_EQ(loss.item<double>(), 0.0);
    EXPECT_EQ(A.grad().abs().max().item<double>(), 0.0);
    EXPECT_EQ(T.grad().abs().max().item<double>(), 0.0);
  }
}

TEST(ArapAgrees, KernelEqualsReference) {
  const ArapGraph graph(actor());
  const int before = at::get_num_threads();
  for (int threads : {1, 2, 3}) {
    at::set_num_threads(threads);
    for (int64_t batch : {0, 1, 3, 5, 17}) {
      std::vector<Tensor> single, exact;
      for (uint64_t seed : {1, 2}) {
        single.push_back(numbers(batch, seed).to(torch::kFloat32).requires_grad_());
        exact.push_back(single.back().detach().to(torch::kFloat64).requires_grad_());
      }
      const Tensor found = arap_loss(single[0], single[1], graph), expected = arap_loss(exact[0], exact[1], graph);
      EXPECT_TRUE(is_near(found, expected, 1e-9, 1e-5)) << batch;
      (3.0 * found).backward();
      (3.0 * expected).backward();
      for (int i = 0; i < 2; ++i) EXPECT_TRUE(is_near(single[i].grad(), exact[i].grad(), 1e-5, 1e-5)) << batch;
    }
  }
  at::set_num_threads(before);
}

TEST(ArapGradient, ReferenceEqualsCentralDifferences) {
  const ArapGraph graph(actor());
  EXPECT_TRUE(gradients_match([&](const auto& x) { return arap_loss(x[0], x[1], graph); },
                              {{"A", numbers(2, 1)}, {"T", numbers(2, 2)}}));
}

TEST(ArapRejects, BadShapesAndEdges) {
  const ArapGraph graph(actor());
  const Tensor good = torch::zeros({2, actor().num_nodes(), 3});
  EXPECT_THAT(message_of([&] { arap_loss(torch::zeros({2, 3, 3}), good, graph); }), testing::HasSubstr("A must be"));
  EXPECT_THAT(message_of([&] {
                arap_loss(good, torch::zeros({1, actor().num_nodes(), 3}), graph);
              }),
              testing::HasSubstr("T must be"));
  EXPECT_THAT(message_of([] { ArapGraph({{0.0, 0.0, 0.0}}, {{0, 1}}, {1.0}); }), testing::HasSubstr("edge 0-1"));
  EXPECT_THAT(message_of([] { ArapGraph({{0.0, 0.0, 0.0}}, {}, {}); }), testing::HasSubstr("1 nodes but 0"));
}

}  // namespace
}  // namespace doppel::arap_test
