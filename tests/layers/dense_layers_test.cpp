#include "doppel/layers/dense_layers/dense_layers.h"

#include <ATen/Parallel.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "doppel/core/error.h"
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

TEST(DenseLayersAgrees, WithProductsInDoubleForAllWidthsAndThreads) {
  const int before = at::get_num_threads();
  for (const std::vector<int64_t>& widths :
       {std::vector<int64_t>{80, 128, 128, 128, 128}, {3, 1}, {17, 70, 5}, {64, 256, 64}})
    for (const int64_t points : {0, 1, 7, 1000})
      for (const LastLayer last : {LastLayer::rectified, LastLayer::linear}) {
        const Layers layers = random_layers(widths);
        const Tensor x = torch::randn({points, widths[0]}, at::detail::createCPUGenerator(1));
        const DenseLayers network(layers, last);
        at::set_num_threads(1);
        const Tensor found = network.forward(x);
        EXPECT_TRUE(test::is_near(found, expected_of(layers, last, x), 1e-5)) << points;
        at::set_num_threads(3);
        EXPECT_TRUE(torch::equal(found, network.forward(x)));
      }
  at::set_num_threads(before);
}

TEST(DenseLayersRejects, LayersThatDoNotFollowEachOther) {
  using support::message_of;
  using ::testing::HasSubstr;
  Layers layers = random_layers({4, 8, 3});
  EXPECT_THAT(message_of([&] { DenseLayers(layers).forward(torch::zeros({2, 5})); }), HasSubstr("points must be"));
  layers[1].first = torch::zeros({3, 9});
  EXPECT_THAT(message_of([&] { DenseLayers network(layers); }), HasSubstr("weight must be"));
  EXPECT_THAT(message_of([&] { DenseLayers network({}); }), HasSubstr("at least one"));
}

}  // namespace
}  // namespace doppel::dense_layers_test
