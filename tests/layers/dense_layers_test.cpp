#include "doppel/layers/dense_layers/dense_layers.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/gradient_check.h"
#include "support/message_of.h"

namespace doppel::dense_layers_test {
namespace {

using torch::Tensor;
using Layers = std::vector<std::pair<Tensor, Tensor>>;

Layers random_layers(const std::vector<int64_t>& widths) {
  auto generator = at::detail::createCPUGenerator(5);
  Layers layers;
  for (std::size_t i = 1; i < widths.size(); ++i)
    layers.emplace_back(torch::randn({widths[i], widths[i - 1]}, generator) / std::sqrt(double(widths[i - 1])),
                        torch::randn({widths[i]}, generator));
  return layers;
}

Tensor expected_of(const Layers& layers, LastLayer last, const Tensor& points) {
  Tensor x = points.to(torch::kFloat64);
  for (const auto& [weight, bias] : layers) {
    x = x.matmul(weight.to(torch::kFloat64).t()) + bias.to(torch::kFloat64);
    if (last == LastLayer::rectified || weight.data_ptr() != layers.back().first.data_ptr()) x = x.relu();
  }
  return x;
}

TEST(DenseLayersAgrees, WithProductsInDoubleForAllWidths) {
  for (const std::vector<int64_t>& widths :
       {std::vector<int64_t>{80, 128, 128, 128, 128}, {3, 1}, {17, 70, 5}, {64, 256, 64}})
    for (const int64_t points : {0, 1, 7, 1000})
      for (const LastLayer last : {LastLayer::rectified, LastLayer::linear}) {
        const Layers layers = random_layers(widths);
        const Tensor x = torch::randn({points, widths[0]}, at::detail::createCPUGenerator(1));
        const DenseLayers network(layers, last);
        Tensor found = torch::empty({points, network.outputs()});
        network.run(x.data_ptr<float>(), points, found.data_ptr<float>());
        EXPECT_TRUE(test::is_near(found, expected_of(layers, last, x), 1e-5)) << points;
      }
}

// Callers split the points as they like.
TEST(DenseLayersAgrees, APointHasTheSameBitsAloneAndAmongOthers) {
  const DenseLayers network(random_layers({17, 70, 5}));
  const Tensor x = torch::randn({50, 17}, at::detail::createCPUGenerator(1));
  Tensor together = torch::empty({50, 5}), alone = torch::empty({50, 5});
  network.run(x.data_ptr<float>(), 50, together.data_ptr<float>());
  for (int64_t i = 0; i < 50; ++i) network.run(x.data_ptr<float>() + 17 * i, 1, alone.data_ptr<float>() + 5 * i);
  EXPECT_TRUE(torch::equal(together, alone));
}

TEST(DenseLayersRejects, LayersThatDoNotFollowEachOther) {
  using support::message_of;
  using ::testing::HasSubstr;
  Layers layers = random_layers({4, 8, 3});
  layers[1].first = torch::zeros({3, 9});
  EXPECT_THAT(message_of([&] { DenseLayers network(layers); }), HasSubstr("weight must be"));
  EXPECT_THAT(message_of([&] { DenseLayers network({}); }), HasSubstr("at least one"));
}

}  // namespace
}  // namespace doppel::dense_layers_test
