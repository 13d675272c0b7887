#include "doppel/losses/radiance.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/types.h>

#include "doppel/core/error.h"
#include "support/gradient_check.h"
#include "support/message_of.h"

namespace doppel::radiance_test {
namespace {

using test::gradients_match;
using torch::Tensor;

/// Rays with intervals of 0.1 and 0.2 m and what was seen along them.
struct Scene {
  RaySamples samples{torch::tensor({3.0, 4.0}, torch::kFloat64), torch::tensor({3.1, 4.2}, torch::kFloat64), {}};
  RenderedRays rays;
  Tensor image = torch::tensor({{0.5, 0.5, 0.5}, {0.2, 0.4, 0.6}}, torch::kFloat64);
  Tensor mask = torch::tensor({1.0, 0.5}, torch::kFloat64);
  Scene() {
    rays.colour = torch::tensor({{0.5, 0.4, 0.7}, {0.1, 0.2, 0.3}}, torch::kFloat64);
    rays.opacity = torch::tensor({0.9, 0.8}, torch::kFloat64);
    rays.variance = torch::tensor({0.1, 0.2}, torch::kFloat64);
  }
};

TEST(RadianceLoss, ByHand) {
  const Scene s;
  const RadianceLoss loss = radiance_loss(s.rays, s.samples, s.image, s.mask);
  EXPECT_NEAR(loss.colour.item<double>(), (0.01 + 0.04) / 2, 1e-12);  // the second ray sees half its image: exact
  EXPECT_NEAR(loss.mask.item<double>(), (0.01 + 0.09) / 2, 1e-12);
  EXPECT_NEAR(loss.variance.item<double>(), (0.01 + 0.04) / 2, 1e-12);
  EXPECT_NEAR(loss.total.item<double>(), 0.025 + 0.05 + 0.01 * 0.025, 1e-12);
  RadianceLossOptions metres;
  metres.variance_in_metres = true;
  EXPECT_NEAR(radiance_loss(s.rays, s.samples, s.image, s.mask, metres).variance.item<double>(),
              (1e-6 + 0.008 * 0.008) / 2, 1e-12);
}

TEST(RadianceLoss, Gradients) {
  const Scene s;
  EXPECT_TRUE(gradients_match(
      [&](const std::vector<Tensor>& in) {
        RenderedRays rays;
        rays.colour = in[0];
        rays.opacity = in[1];
        rays.variance = in[2];
        return radiance_loss(rays, s.samples, s.image, s.mask).total;
      },
      {{"colour", s.rays.colour}, {"opacity", s.rays.opacity}, {"variance", s.rays.variance}}));
}

// Density drawn together in one position lowers the loss; density behind what is opaque changes nothing.
TEST(RadianceLoss, VarianceCountsWhatIsSeen) {
  const RaySamples samples =
      sample_cells(torch::tensor({3.0}, torch::kFloat64), torch::tensor({3.08}, torch::kFloat64), 8);
  const auto variance = [&](std::vector<double> density) {
    const RenderedRays rays = render_volume(torch::tensor(density, torch::kFloat64).unsqueeze(0),
                                            torch::zeros({1, 8, 3}, torch::kFloat64), samples);
    return radiance_loss(rays, samples, torch::zeros({1, 3}, torch::kFloat64), torch::ones({1}, torch::kFloat64))
        .variance.item<double>();
  };
  EXPECT_LT(variance({0, 0, 50, 50, 0, 0, 0, 0}), 0.1 * variance({0, 50, 0, 0, 0, 0, 50, 0}));
  EXPECT_NEAR(variance({0, 0, 1e6, 0, 0, 0, 0, 0}), variance({0, 0, 1e6, 0, 0, 0, 0, 1e6}), 1e-20);
}

TEST(RadianceLoss, NoRaysAndWrongShapes) {
  const RaySamples none = sample_cells(torch::zeros({0}), torch::zeros({0}), 4);
  const RenderedRays rays = render_volume(torch::zeros({0, 4}), torch::zeros({0, 4, 3}), none);
  EXPECT_EQ(radiance_loss(rays, none, torch::zeros({0, 3}), torch::zeros({0})).total.item<float>(), 0.0f);
  const Scene s;
  EXPECT_THAT(support::message_of<UsageError>([&] { radiance_loss(s.rays, s.samples, s.mask, s.mask); }),
              testing::HasSubstr("image must be"));
}

}  // namespace
}  // namespace doppel::radiance_test
