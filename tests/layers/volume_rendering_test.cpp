#include "doppel/layers/volume_rendering/volume_rendering.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/types.h>

#include <cmath>
#include <limits>

#include "doppel/core/error.h"
#include "support/gradient_check.h"
#include "support/layer_inputs.h"
#include "support/message_of.h"

namespace doppel::volume_rendering_test {
namespace {

using support::message_of;
using namespace test;
using torch::Tensor;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

Tensor doubles(std::vector<double> values) { return torch::tensor(values, torch::kFloat64); }

/// One ray from `near` to `far`.
RaySamples one_ray(double near, double far, int64_t samples) {
  return sample_cells(doubles({near}), doubles({far}), samples);
}

TEST(SampleCells, MiddlesOfEqualCells) {
  const RaySamples samples = one_ray(2.0, 3.0, 4);
  EXPECT_TRUE(is_near(samples.t, doubles({2.125, 2.375, 2.625, 2.875}).unsqueeze(0), 1e-15));
  EXPECT_TRUE(is_near(samples.step(), doubles({0.25}).unsqueeze(0), 1e-15));
  const Tensor points = samples.points(doubles({1, 0, 0}).unsqueeze(0), doubles({0, 0.6, 0.8}).unsqueeze(0));
  EXPECT_TRUE(is_near(points[0][0], doubles({1, 2.125 * 0.6, 2.125 * 0.8}), 1e-15));
}

TEST(SampleByWeight, FollowsTheWeightsAndCoversTheRay) {
  const RaySamples coarse = one_ray(1.0, 5.0, 4);  // cells of 1 m
  const RaySamples fine = sample_by_weight(coarse, doubles({0.0, 3.0, 0.0, 1.0}).unsqueeze(0), 400);
  ASSERT_EQ(fine.t.size(1), 404);
  EXPECT_TRUE((fine.t.narrow(1, 1, 403) >= fine.t.narrow(1, 0, 403)).all().item<bool>());
  const auto within = [&](double low, double high) { return ((fine.t > low) & (fine.t < high)).sum().item<int64_t>(); };
  EXPECT_NEAR(within(2.0, 3.0), 301, 2);  // three quarters, and the coarse one
  EXPECT_NEAR(within(4.0, 5.0), 101, 2);
  EXPECT_LE(within(1.0, 2.0) + within(3.0, 4.0), 4);
  EXPECT_NEAR(fine.step().sum().item<double>(), 4.0, 1e-9);
  EXPECT_GE(fine.step().min().item<double>(), 0.0);
}

TEST(SampleByWeight, AConstantSlabIsSeenTheSameWithAnyCells) {
  const RaySamples coarse = one_ray(0.0, 2.0, 8);
  const RaySamples fine =
      sample_by_weight(coarse, doubles({0, 0, 1, 5, 1, 0, 0, 0}).unsqueeze(0), 24, at::detail::createCPUGenerator(2));
  const Tensor density = torch::full({1, 32}, 0.7, torch::kFloat64), colour = torch::ones({1, 32, 1}, torch::kFloat64);
  EXPECT_NEAR(render_volume(density, colour, fine).opacity.item<double>(), 1.0 - std::exp(-1.4), 1e-12);
}

TEST(SampleByWeight, RaysWithoutLengthOrWeightAreHarmless) {
  const RaySamples empty = one_ray(2.0, 2.0, 3);
  const RaySamples fine = sample_by_weight(empty, torch::zeros({1, 3}, torch::kFloat64), 5);
  EXPECT_TRUE(is_near(fine.t, torch::full({1, 8}, 2.0, torch::kFloat64), 1e-12));
  EXPECT_EQ(fine.step().abs().sum().item<double>(), 0.0);
  EXPECT_THAT(message_of([&] {
                sample_by_weight(empty, torch::zeros({1, 4}, torch::kFloat64), 5);
              }),
              ::testing::HasSubstr("weights"));
}

TEST(SampleCells, OneInEveryCellBySeed) {
  const Tensor near = torch::full({500}, 1.0), far = torch::full({500}, 2.0);
  const auto draw = [&](uint64_t seed) { return sample_cells(near, far, 8, at::detail::createCPUGenerator(seed)).t; };
  const Tensor t = draw(1), position = (t - 1.0) * 8.0 - torch::arange(8);
  EXPECT_GT(position.min().item<float>(), -1e-5f);
  EXPECT_LT(position.max().item<float>(), 1.0f + 1e-5f);
  EXPECT_NEAR(position.mean().item<double>(), 0.5, 0.02);
  EXPECT_TRUE(torch::equal(t, draw(1)));
  EXPECT_FALSE(torch::equal(t, draw(2)));
}

// The loop that images take, on rays that are empty, opaque, faint and without meaning.
TEST(RenderRay, EqualsRenderVolume) {
  auto generator = at::detail::createCPUGenerator(4);
  constexpr int64_t R = 40, K = 9;
  const Tensor near = torch::rand({R}, generator) + 1.0, far = near + torch::rand({R}, generator) - 0.2;
  const RaySamples samples = sample_cells(near, far, K);
  Tensor density = torch::pow(10.0, 8.0 * torch::rand({R, K}, generator) - 3.0) *
                   (torch::rand({R, K}, generator) > 0.5).to(torch::kFloat32);
  density[3][2] = kInfinity;
  density[4][0] = std::numeric_limits<float>::quiet_NaN();
  density[5][1] = -3.0;
  const RenderedRays expected = render_volume(density, torch::zeros({R, K, 3}), samples);
  Tensor weights = torch::empty({K});
  for (int64_t r = 0; r < R; ++r) {
    const RaySums seen = render_ray(density[r].data_ptr<float>(), samples.t[r].data_ptr<float>(), K,
                                    near[r].item<float>(), far[r].item<float>(), weights.data_ptr<float>());
    EXPECT_TRUE(is_near(weights, expected.weights[r], 1e-6)) << r;
    EXPECT_NEAR(seen.opacity, expected.opacity[r].item<float>(), 1e-6) << r;
    EXPECT_NEAR(seen.depth, expected.depth[r].item<float>(), 1e-5) << r;
  }
}

// A slab of constant density and colour: opacity 1 - exp(-sigma L), whatever the number of samples.
TEST(VolumeRendering, ConstantSlab) {
  for (int64_t samples : {1, 7, 64})
    for (double density : {1e-9, 0.3, 20.0, 400.0}) {
      const RaySamples ray = one_ray(3.0, 3.1, samples);
      const Tensor colour = doubles({0.2, 0.5, 0.9});
      const RenderedRays seen =
          render_volume(torch::full({1, samples}, density, torch::kFloat64), colour.expand({1, samples, 3}), ray);
      const double opacity = -std::expm1(-density * 0.1);
      EXPECT_NEAR(seen.opacity.item<double>(), opacity, 1e-15 + 1e-13 * opacity);
      EXPECT_TRUE(is_near(seen.colour[0], opacity * colour, 1e-15, 1e-13));
      EXPECT_TRUE(is_near(seen.weights.sum(1), seen.opacity, 1e-15, 1e-12));
    }
}

// In the limit of many samples the depth in a slab is that of an exponential law cut off at its length L:
// mean = 1/sigma - L exp(-sigma L) / (1 - exp(-sigma L)), variance = 1/sigma^2 - L^2 exp(-sigma L) / (1 - exp(-sigma
// L))^2.
TEST(VolumeRendering, DepthAndVarianceOfASlab) {
  const double L = 0.1, sigma = 30.0, rest = std::exp(-sigma * L), opacity = 1.0 - rest;
  const RaySamples ray = one_ray(3.0, 3.0 + L, 20000);
  const RenderedRays seen =
      render_volume(torch::full({1, 20000}, sigma, torch::kFloat64), torch::zeros({1, 20000, 3}, torch::kFloat64), ray);
  EXPECT_NEAR(seen.depth.item<double>(), 3.0 + 1.0 / sigma - L * rest / opacity, 1e-9);
  const double variance = 1.0 / (sigma * sigma) - L * L * rest / (opacity * opacity);
  EXPECT_NEAR(seen.variance.item<double>(), variance / (L * L), 1e-7);
}

TEST(VolumeRendering, AnOpaquePlaneIsExact) {
  for (const auto type : {torch::kFloat32, torch::kFloat64}) {
    RaySamples ray = one_ray(4.0, 4.08, 64);
    ray = {ray.near.to(type), ray.far.to(type), ray.t.to(type)};
    Tensor density = torch::zeros({1, 64}, type), colour = torch::rand({1, 64, 3}, type);
    density.slice(1, 40).fill_(kInfinity);  // what stands behind the plane is not seen
    const RenderedRays seen = render_volume(density, colour, ray);
    EXPECT_EQ(seen.opacity.item<double>(), 1.0);
    EXPECT_TRUE(is_near(seen.colour, colour.select(1, 40), 1e-20));
    EXPECT_NEAR(seen.depth.item<double>(), ray.t[0][40].item<double>(), type == torch::kFloat32 ? 5e-7 : 1e-14);
    EXPECT_NEAR(seen.variance.item<double>(), 0.0, 1e-13);
  }
}

TEST(VolumeRendering, EmptyRaysAreExact) {
  const RaySamples rays = sample_cells(doubles({2.0, 5.0}), doubles({2.5, 5.0}), 8);  // the second has no length
  Tensor density = torch::zeros({2, 8}, torch::kFloat64);
  density[1].fill_(kInfinity);
  const RenderedRays seen = render_volume(density, torch::ones({2, 8, 3}, torch::kFloat64), rays);
  EXPECT_TRUE(torch::equal(seen.opacity, torch::zeros({2}, torch::kFloat64)));
  EXPECT_TRUE(torch::equal(seen.colour, torch::zeros({2, 3}, torch::kFloat64)));
  EXPECT_TRUE(torch::equal(seen.depth, rays.near));
  EXPECT_TRUE(torch::equal(seen.variance, torch::zeros({2}, torch::kFloat64)));
}

// What 6.26 lacks: a surface of opacity 0.98 at 4 m would stand 8 cm too near.
TEST(VolumeRendering, DepthIsDividedByTheOpacity) {
  const RaySamples ray = one_ray(3.96, 4.04, 65);
  Tensor density = torch::zeros({1, 65}, torch::kFloat64);
  density[0][32] = -std::log(0.02) / ray.step().item<double>();
  const RenderedRays seen = render_volume(density, torch::zeros({1, 65, 3}, torch::kFloat64), ray);
  EXPECT_NEAR(seen.opacity.item<double>(), 0.98, 1e-12);
  EXPECT_NEAR(seen.depth.item<double>(), 4.0, 1e-12);
  EXPECT_NEAR((seen.weights * ray.t).sum().item<double>(), 3.92, 1e-12);
}

TEST(VolumeRendering, Gradients) {
  const Tensor density = (4.0 * test::random_numbers({5, 6}, 1)).exp();
  const Tensor colour = test::random_numbers({5, 6, 3}, 2), near = 3.0 + 0.1 * test::random_numbers({5}, 3);
  const Tensor far = near + 0.3 + 0.1 * test::random_numbers({5}, 4);
  EXPECT_TRUE(gradients_match(
      [](const std::vector<Tensor>& in) {
        const RenderedRays seen = render_volume(in[0], in[1], sample_cells(in[2], in[3], 6));
        return torch::cat(
            {seen.colour, seen.opacity.unsqueeze(1), seen.depth.unsqueeze(1), seen.variance.unsqueeze(1), seen.weights},
            1);
      },
      {{"density", density}, {"colour", colour}, {"near", near}, {"far", far}}));
}

TEST(VolumeRendering, NothingButNumbersLeavesIt) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Tensor density = doubles({kInfinity, nan, -3.0, 0.0, 1e30, 1e-30, kInfinity, 2.0}).view({2, 4}).requires_grad_();
  Tensor colour = torch::full({2, 4, 3}, 0.5, torch::kFloat64);
  colour[0][1][0] = nan;
  colour.requires_grad_();
  Tensor near = doubles({1.0, 2.0}).requires_grad_(), far = doubles({1.1, 2.0}).requires_grad_();
  const RenderedRays seen = render_volume(density, colour, sample_cells(near, far, 4));
  Tensor sum = torch::zeros({}, torch::kFloat64);
  for (const Tensor& part : {seen.colour, seen.opacity, seen.depth, seen.variance, seen.weights}) {
    EXPECT_TRUE(part.isfinite().all().item<bool>());
    sum = sum + part.sum();
  }
  sum.backward();
  for (const Tensor& leaf : {density, colour, near, far}) EXPECT_TRUE(leaf.grad().isfinite().all().item<bool>());
}

TEST(VolumeRendering, RejectsWhatDoesNotFit) {
  const RaySamples ray = one_ray(1, 2, 4);
  const Tensor density = torch::zeros({1, 4}, torch::kFloat64);
  EXPECT_THAT(message_of<UsageError>([&] {
                render_volume(density, torch::zeros({1, 3, 3}, torch::kFloat64), ray);
              }),
              testing::HasSubstr("colour must be"));
  EXPECT_THAT(message_of<UsageError>([&] {
                render_volume(torch::zeros({1, 5}, torch::kFloat64), torch::zeros({1, 5, 3}, torch::kFloat64), ray);
              }),
              testing::HasSubstr("samples.t must be"));
  EXPECT_THAT(message_of<UsageError>([&] { one_ray(1, 2, 0); }), testing::HasSubstr("at least 1"));
}

}  // namespace
}  // namespace doppel::volume_rendering_test
