#include "doppel/losses/laplacian.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "doppel/core/error.h"
#include "support/gradient_check.h"
#include "support/message_of.h"
#include "support/test_character.h"

namespace doppel::laplacian_test {
namespace {

using support::message_of;
using namespace test;
using torch::Tensor;

const Character& actor() {
  static const Character character = make_test_character(5, 7, 17);
  return character;
}

/// The test character's graph with rigidities that differ.
LaplacianGraph graph() {
  std::vector<double> rigidity;
  for (int i = 0; i < actor().num_vertices(); ++i) rigidity.push_back(1.0 + (i * 7) % 11);
  return LaplacianGraph(MeshTopology(actor().mesh), rigidity);
}

Tensor vertices(int64_t batch, uint64_t seed, double size) {
  return size * torch::randn({batch, actor().num_vertices(), 3}, at::detail::createCPUGenerator(seed), torch::kFloat64);
}

// A path 0-1-2 and a vertex of its own; only vertex 1 moves, by (1,2,2), length 3.
TEST(LaplacianReference, PathByHand) {
  const LaplacianGraph path(MeshTopology(4, {{0, 1}, {1, 2}}), {1.0, 3.0, 5.0, 9.0});
  EXPECT_EQ(path.num_edges, 4);
  const double w0 = 2.0, w1 = (2.0 + 4.0) / 2, w2 = 4.0;
  Tensor coarse = torch::rand({2, 4, 3}, at::detail::createCPUGenerator(1), torch::kFloat64), fine = coarse.clone();
  fine[1][1] += torch::tensor({1.0, 2.0, 2.0}, torch::kFloat64);
  const double expected = (w0 * 9 + w1 * 36 + w2 * 9) / (2 * 4);
  EXPECT_NEAR(laplacian_loss(fine, coarse, path).item<double>(), expected, 1e-12);
  EXPECT_NEAR(laplacian_loss(fine.to(torch::kFloat32), coarse.to(torch::kFloat32), path).item<double>(), expected,
              1e-5);
}

TEST(LaplacianReference, WeighsAVertexByItsOwnRigidity) {
  const LaplacianGraph path(MeshTopology(4, {{0, 1}, {1, 2}}), {1.0, 3.0, 5.0, 9.0}, LaplacianWeights::vertex);
  const Tensor coarse = torch::zeros({1, 4, 3}, torch::kFloat64);
  Tensor fine = coarse.clone();
  fine[0][1] += torch::tensor({1.0, 2.0, 2.0}, torch::kFloat64);
  EXPECT_NEAR(laplacian_loss(fine, coarse, path).item<double>(), (1.0 * 9 + 3.0 * 36 + 5.0 * 9) / 4, 1e-12);
}

TEST(LaplacianReference, TakesTheRigidityOfTheNamedTable) {
  Character labelled = actor();
  labelled.labels.assign(actor().num_vertices(), 5);  // upper clothes: 2, 10 and 1
  const auto weight = [&](RigidityPreset table) {
    return LaplacianGraph(labelled, {table, LaplacianWeights::vertex}).weight.max().item<double>();
  };
  EXPECT_EQ(weight(RigidityPreset::livecap), 2.0);
  EXPECT_EQ(weight(RigidityPreset::graph), 10.0);
  EXPECT_EQ(weight(RigidityPreset::laplacian), 1.0);
}

TEST(LaplacianReference, CommonDisplacementsCostNothing) {
  const Tensor coarse = vertices(2, 1, 0.5);
  const Tensor moved = coarse + torch::tensor({0.1, -0.2, 0.3}, torch::kFloat64);
  EXPECT_NEAR(laplacian_loss(moved, coarse, graph()).item<double>(), 0.0, 1e-20);
}

TEST(LaplacianReference, CharacterWithoutLabelsWeighsEverythingAlike) {
  const LaplacianGraph plain(actor());
  EXPECT_EQ(plain.num_vertices, actor().num_vertices());
  EXPECT_EQ(plain.num_edges, 2 * static_cast<int64_t>(MeshTopology(actor().mesh).edges().size()));
  Character labelled = actor();
  labelled.labels.assign(actor().num_vertices(), 13);
  EXPECT_FALSE(torch::equal(LaplacianGraph(labelled).weight, plain.weight));
}

TEST(LaplacianAgrees, KernelEqualsReference) {
  const LaplacianGraph g = graph();
  const int before = at::get_num_threads();
  for (int64_t batch : {0, 1, 2, 5}) {
    const Tensor coarse = vertices(batch, 1, 0.5).to(torch::kFloat32), d = vertices(batch, 2, 0.01).to(torch::kFloat32);
    Tensor exact = (coarse + d).to(torch::kFloat64).requires_grad_();
    const Tensor expected = laplacian_loss(exact, coarse.to(torch::kFloat64), g);
    (3.0 * expected).backward();
    Tensor first;
    for (int threads : {1, 2, 3}) {
      at::set_num_threads(threads);
      Tensor fine = (coarse + d).requires_grad_();
      const Tensor found = laplacian_loss(fine, coarse, g);
      (3.0 * found).backward();
      EXPECT_TRUE(is_near(found, expected, 1e-12, 1e-4)) << batch;
      const double size = batch > 0 ? exact.grad().abs().max().item<double>() : 0.0;
      EXPECT_TRUE(is_near(fine.grad(), exact.grad(), 1e-5 * size + 1e-12, 1e-4)) << batch;
      if (threads == 1) first = fine.grad();
      EXPECT_TRUE(torch::equal(fine.grad(), first));
    }
  }
  at::set_num_threads(before);
}

TEST(LaplacianGradient, ReferenceEqualsCentralDifferences) {
  const LaplacianGraph g = graph();
  const Tensor coarse = vertices(2, 1, 0.5);
  EXPECT_TRUE(
      gradients_match([&](const auto& x) { return laplacian_loss(x[0], coarse, g); }, {{"V_fi", vertices(2, 2, 0.5)}}));
}

TEST(LaplacianGradient, NoneToTheCoarseVertices) {
  for (auto type : {torch::kFloat32, torch::kFloat64}) {
    Tensor coarse = vertices(2, 1, 0.5).to(type).requires_grad_(), fine = vertices(2, 2, 0.5).to(type).requires_grad_();
    laplacian_loss(fine, coarse, graph()).backward();
    EXPECT_FALSE(coarse.grad().defined());
    EXPECT_GT(fine.grad().abs().max().item<double>(), 0.0);
  }
}

TEST(LaplacianRejects, BadShapes) {
  const Tensor good = torch::zeros({2, actor().num_vertices(), 3});
  EXPECT_THAT(message_of<UsageError>([&] {
                laplacian_loss(torch::zeros({2, 3, 3}), good, graph());
              }),
              testing::HasSubstr("V_fi must be"));
  EXPECT_THAT(message_of<UsageError>([&] { laplacian_loss(good, good.slice(0, 0, 1), graph()); }),
              testing::HasSubstr("V_co must be"));
  EXPECT_THAT(message_of<UsageError>([&] { laplacian_loss(good, good.to(torch::kFloat64), graph()); }),
              testing::HasSubstr("float64"));
  EXPECT_THAT(message_of([] {
                LaplacianGraph(MeshTopology(3, {{0, 1}}), {1.0});
              }),
              testing::HasSubstr("3 vertices but 1"));
}

}  // namespace
}  // namespace doppel::laplacian_test
