#include "doppel/render/splats/splats.h"

#include <ATen/Parallel.h>
#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "doppel/core/error.h"
#include "support/gradient_check.h"

namespace doppel::splats_test {
namespace {

using torch::Tensor;

constexpr std::int64_t kHeight = 40, kWidth = 56;

/// How the Gaussians of a random scene are shaped.
struct Kind {
  std::string name;
  double scale;    ///< metres, the geometric mean of the standard deviations
  double stretch;  ///< of ln(standard deviation)
  double opacity;  ///< mean logit
};
const std::vector<Kind> kKinds = {{"round", 0.03, 0.1, 0.0},
                                  {"tilted and thin", 0.03, 1.5, 0.0},
                                  {"tiny", 2e-4, 0.5, 1.0},
                                  {"huge", 1.0, 0.5, -1.0},
                                  {"opaque", 0.05, 0.5, 4.0}};

/// Two cameras in front of and beside the origin, the second with skew.
Tensor two_cameras() {
  const Tensor front =
      torch::tensor({60.0, 0.0, 28.0, 28.0 * 2.5, 0.0, 60.0, 20.0, 20.0 * 2.5, 0.0, 0.0, 1.0, 2.5}, torch::kFloat64);
  const Tensor side =
      torch::tensor({26.0, 2.0, -55.0, 26.0 * 2.2, 21.0, 62.0, 1.0, 21.0 * 2.2, 1.0, 0.05, 0.0, 2.2}, torch::kFloat64);
  return torch::stack({front, side}).view({1, 2, 3, 4});
}

/// Gaussians in a cube of one metre around the origin.
Splats random_splats(const Kind& kind, std::int64_t batch, std::int64_t count, std::int64_t harmonics, bool normals) {
  auto generator = at::detail::createCPUGenerator(11);
  const auto normal = [&](torch::IntArrayRef sizes) { return torch::randn(sizes, generator, torch::kFloat32); };
  Splats s;
  s.positions = torch::rand({batch, count, 3}, generator, torch::kFloat32) - 0.5;
  s.rotations = normal({batch, count, 4});
  s.log_scales = normal({batch, count, 3}) * kind.stretch + std::log(kind.scale);
  s.opacities = normal({batch, count}) + kind.opacity;
  s.harmonics = normal({batch, count, harmonics, 3}) * 0.5;
  if (normals) s.normals = normal({batch, count, 3});
  return s;
}

Splats converted(const Splats& s, torch::ScalarType type, bool gradients) {
  Splats out = s;
  for (Tensor* t : {&out.positions, &out.rotations, &out.log_scales, &out.opacities, &out.harmonics})
    *t = t->detach().to(type).clone().requires_grad_(gradients);
  if (out.normals.defined()) out.normals = out.normals.to(type);
  return out;
}

struct NamedGradient {
  std::string name;
  Tensor value;
};
/// The gradients of a fixed weighted sum of the images.
std::vector<NamedGradient> gradients_of(const Splats& s, const Tensor& projection, const SplatOptions& options) {
  const SplatImage image = draw_splats(s, projection, kHeight, kWidth, options);
  auto generator = at::detail::createCPUGenerator(5);
  const auto weighted = [&](const Tensor& t) {
    return (t * torch::randn(t.sizes(), generator, torch::kFloat32).to(t.scalar_type())).sum();
  };
  (weighted(image.colour) + weighted(image.alpha) + weighted(image.depth)).backward();
  return {{"positions", s.positions.grad()},
          {"rotations", s.rotations.grad()},
          {"log_scales", s.log_scales.grad()},
          {"opacities", s.opacities.grad()},
          {"harmonics", s.harmonics.grad()}};
}

double largest_error(const Tensor& found, const Tensor& expected) {
  return ((found.to(torch::kFloat64) - expected).abs().max() / expected.abs().max().clamp_min(1e-30)).item<double>();
}

TEST(DrawSplatsKernel, AgreesWithTheReferenceInDouble) {
  const SplatOptions with_depth{0.01f, true, false};
  for (const Kind& kind : kKinds) {
    for (const std::int64_t harmonics : {1, 4, 9, 16}) {
      SCOPED_TRACE(kind.name + ", " + std::to_string(harmonics) + " harmonics");
      const Splats s = random_splats(kind, 2, 150, harmonics, harmonics == 4);
      const Tensor projection = two_cameras().expand({2, 2, 3, 4});
      const Splats single = converted(s, torch::kFloat32, true), twice = converted(s, torch::kFloat64, true);
      const SplatImage found = draw_splats(single, projection.to(torch::kFloat32), kHeight, kWidth, with_depth),
                       expected = draw_splats(twice, projection, kHeight, kWidth, with_depth);
      EXPECT_GT(expected.alpha.max().item<double>(), 0.02);
      EXPECT_LT(largest_error(found.colour, expected.colour), 1e-5);
      EXPECT_LT(largest_error(found.alpha, expected.alpha), 1e-5);
      EXPECT_LT(largest_error(found.depth, expected.depth), 1e-5);
      const auto left = gradients_of(single, projection.to(torch::kFloat32), with_depth);
      const auto right = gradients_of(twice, projection, with_depth);
      for (std::size_t k = 0; k < left.size(); ++k)
        EXPECT_LT(largest_error(left[k].value, right[k].value), 1e-4) << left[k].name;
    }
  }
}

TEST(DrawSplatsReference, GradientsAgreeWithCentralDifferences) {
  for (const Kind& kind : kKinds) {
    for (const std::int64_t harmonics : {1, 16}) {
      SCOPED_TRACE(kind.name + ", " + std::to_string(harmonics) + " harmonics");
      const Splats s = converted(random_splats(kind, 1, 12, harmonics, false), torch::kFloat64, false);
      const Tensor projection = two_cameras();
      const auto draw = [&](const std::vector<Tensor>& in) {
        const SplatImage image =
            draw_splats({in[0], in[1], in[2], in[3], in[4], {}}, projection, kHeight, kWidth, {0.01f, true, false});
        return torch::cat({image.colour, image.alpha.unsqueeze(4), image.depth.unsqueeze(4)}, 4);
      };
      test::GradientOptions options;
      options.absolute = 1e-6;
      options.relative = 1e-5;
      options.elements = 24;
      EXPECT_TRUE(test::gradients_match(draw,
                                        {{"positions", s.positions},
                                         {"rotations", s.rotations},
                                         {"log_scales", s.log_scales},
                                         {"opacities", s.opacities},
                                         {"harmonics", s.harmonics}},
                                        options));
    }
  }
}

/// One Gaussian on the axis of a camera at the origin, focal length 100, principal point at the centre of a pixel.
Splats on_axis(double depth, double scale, double logit, const std::vector<double>& grey) {
  const auto floats = torch::kFloat32;
  const auto colours = static_cast<std::int64_t>(grey.size());
  Splats s;
  s.positions = torch::zeros({1, colours, 3}, floats);
  for (std::int64_t i = 0; i < colours; ++i) s.positions[0][i][2] = depth + static_cast<double>(i);
  s.rotations = torch::tensor({2.0, 0.0, 0.0, 0.0}, floats).expand({1, colours, 4});
  s.log_scales = torch::full({1, colours, 3}, std::log(scale), floats);
  s.opacities = torch::full({1, colours}, logit, floats);
  s.harmonics = ((torch::tensor(grey, floats) - 0.5) / 0.28209479177387814).view({1, -1, 1, 1}).expand({1, -1, 1, 3});
  return s;
}
Tensor axis_camera() {
  return torch::tensor({100.0, 0.0, 20.5, 0.0, 0.0, 100.0, 20.5, 0.0, 0.0, 0.0, 1.0, 0.0}, torch::kFloat32)
      .view({1, 1, 3, 4});
}

TEST(DrawSplats, OneGaussianIsThePublishedFormula) {
  const Splats s = on_axis(2.0, 0.05, std::log(0.8 / 0.2), {0.7});
  const SplatImage image = draw_splats(s, axis_camera(), 41, 41, {0.01f, true, false});
  const double variance = 2.5 * 2.5 + 0.3;
  for (const int dx : {0, 1, 3, 7}) {
    const double alpha = 0.8 * std::exp(-0.5 * dx * dx / variance);
    EXPECT_NEAR(image.alpha[0][0][20][20 + dx].item<double>(), alpha, 1e-6);
    EXPECT_NEAR(image.colour[0][0][20 + dx][20][1].item<double>(), 0.7 * alpha, 1e-6);
    EXPECT_NEAR(image.depth[0][0][20 - dx][20].item<double>(), 2.0 * alpha, 3e-6);
  }
  EXPECT_EQ(image.alpha[0][0][20][20 + 9].item<double>(), 0.0) << "below 1/255";
}

TEST(DrawSplats, NearerGaussiansHideOthersWhateverTheirOrder) {
  const Splats s = on_axis(2.0, 0.05, std::log(0.8 / 0.2), {1.0, 0.2, 0.6});
  const double expected = 0.8 * 1.0 + 0.2 * 0.8 * 0.2 + 0.2 * 0.2 * 0.8 * 0.6;
  for (const std::vector<std::int64_t>& order : {std::vector<std::int64_t>{0, 1, 2}, {2, 0, 1}, {2, 1, 0}}) {
    const Tensor index = torch::tensor(order);
    Splats other = s;
    for (Tensor* t : {&other.positions, &other.rotations, &other.log_scales, &other.opacities, &other.harmonics})
      *t = t->index_select(1, index);
    const SplatImage image = draw_splats(other, axis_camera(), 41, 41);
    EXPECT_NEAR(image.colour[0][0][20][20][0].item<double>(), expected, 1e-6);
    EXPECT_NEAR(image.alpha[0][0][20][20].item<double>(), 1.0 - 0.2 * 0.2 * 0.2, 1e-6);
  }
}

TEST(DrawSplats, APixelTakesNoMoreBelowTheLeastTransmittance) {
  // 0.99 at most: transmittance 1e-2, 1e-4 by rounding, then nothing more may change the colour.
  const Splats three = on_axis(2.0, 0.05, 20.0, {0.5, 0.5, 0.5, 0.5, 0.5});
  const SplatImage image = draw_splats(three, axis_camera(), 41, 41);
  EXPECT_GE(image.alpha[0][0][20][20].item<double>(), 0.9999 - 1e-6);
  EXPECT_LE(image.alpha[0][0][20][20].item<double>(), 1.0 - 1e-6 + 1e-7);
}

constexpr std::int64_t kBad = 12;

TEST(DrawSplats, GaussiansThatCannotBeDrawnAreLeftOutAndHaveNoGradient) {
  const Kind& kind = kKinds[0];
  const Tensor projection = two_cameras().to(torch::kFloat32);
  const Splats good = random_splats(kind, 1, 20, 4, false);
  const float nan = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();
  Splats bad = random_splats(kind, 1, 32, 4, false);
  bad.positions[0][0][0] = nan;
  bad.rotations[0][1].fill_(0.0);
  bad.log_scales[0][2][1] = infinity;
  bad.log_scales[0][3][1] = 200.0;
  bad.harmonics[0][4][3][0] = nan;
  bad.opacities[0][5] = -30.0;
  bad.opacities[0][6] = nan;
  bad.log_scales[0][8][0] = -infinity;
  bad.opacities[0][9] = infinity;
  bad.rotations[0][10].fill_(1e20f);
  bad.rotations[0][11].fill_(1e-20f);
  bad.positions[0][7] = torch::tensor({-9.0, 0.0, -9.0});  // behind both cameras
  const auto joined = [](const Tensor& a, const Tensor& b) {
    return torch::cat({a.detach(), b.narrow(1, 0, kBad)}, 1).requires_grad_();
  };
  const Splats all = {joined(good.positions, bad.positions),   joined(good.rotations, bad.rotations),
                      joined(good.log_scales, bad.log_scales), joined(good.opacities, bad.opacities),
                      joined(good.harmonics, bad.harmonics),   {}};
  const SplatImage image = draw_splats(all, projection, kHeight, kWidth);
  EXPECT_TRUE(image.colour.equal(draw_splats(good, projection, kHeight, kWidth).colour));
  SplatOptions plain;
  plain.use_reference = true;
  EXPECT_TRUE(draw_splats(all, projection, kHeight, kWidth, plain)
                  .colour.equal(draw_splats(good, projection, kHeight, kWidth, plain).colour));
  image.colour.sum().backward();
  for (const Tensor& t : {all.positions, all.rotations, all.log_scales, all.opacities, all.harmonics}) {
    EXPECT_EQ(t.grad().narrow(1, 20, kBad).abs().sum().item<double>(), 0.0);
    EXPECT_GT(t.grad().narrow(1, 0, 20).abs().sum().item<double>(), 0.0);
  }
}

TEST(DrawSplats, OnlyGaussiansThatFaceTheCameraIfThereAreNormals) {
  Splats s = on_axis(2.0, 0.05, 0.0, {1.0});
  s.normals = torch::tensor({0.0f, 0.0f, 1.0f}).view({1, 1, 3});
  EXPECT_EQ(draw_splats(s, axis_camera(), 41, 41).alpha.max().item<double>(), 0.0);
  s.normals = -s.normals;
  EXPECT_NEAR(draw_splats(s, axis_camera(), 41, 41).alpha.max().item<double>(), 0.5, 1e-6);
}

TEST(DrawSplats, TheScaleOfTheProjectionChangesNothing) {
  const Splats s = random_splats(kKinds[1], 1, 50, 4, false);
  const Tensor projection = two_cameras().to(torch::kFloat32);
  const SplatOptions options{0.01f, true, false};
  const SplatImage one = draw_splats(s, projection, kHeight, kWidth, options),
                   other = draw_splats(s, projection * 4.0, kHeight, kWidth, options);
  EXPECT_TRUE(test::is_near(one.colour, other.colour, 1e-6));
  EXPECT_TRUE(test::is_near(one.depth, other.depth, 1e-5));
}

TEST(DrawSplats, GivesTheSameBitsForAnyNumberOfThreads) {
  const int before = at::get_num_threads();
  std::vector<NamedGradient> expected;
  Tensor colour;
  for (const int threads : {1, 2, 3}) {
    at::set_num_threads(threads);
    const Splats s = converted(random_splats(kKinds[1], 2, 9000, 4, false), torch::kFloat32, true);
    const Tensor projection = two_cameras().to(torch::kFloat32).expand({2, 2, 3, 4});
    const SplatOptions options{0.01f, true, false};
    const Tensor drawn = draw_splats(s, projection, kHeight, kWidth, options).colour.detach().clone();
    const auto found = gradients_of(s, projection, options);
    if (threads == 1) {
      expected = found;
      colour = drawn;
    }
    EXPECT_TRUE(drawn.equal(colour)) << threads;
    for (std::size_t k = 0; k < found.size(); ++k)
      EXPECT_TRUE(found[k].value.equal(expected[k].value)) << found[k].name << ", " << threads << " threads";
  }
  at::set_num_threads(before);
}

TEST(DrawSplats, NothingToDraw) {
  const Splats none = random_splats(kKinds[0], 1, 0, 1, false), some = random_splats(kKinds[0], 1, 5, 1, false);
  const Tensor projection = two_cameras().to(torch::kFloat32);
  EXPECT_EQ(draw_splats(none, projection, 8, 8).alpha.abs().sum().item<double>(), 0.0);
  EXPECT_EQ(draw_splats(some, torch::zeros({1, 2, 3, 4}), 8, 8).alpha.abs().sum().item<double>(), 0.0);
  EXPECT_EQ(draw_splats(some, torch::zeros({1, 0, 3, 4}), 8, 8).colour.size(1), 0);
  EXPECT_FALSE(draw_splats(some, projection, 8, 8).depth.defined());
}

TEST(DrawSplatsRejects, ArgumentsThatDoNotFit) {
  const Splats s = random_splats(kKinds[0], 1, 5, 1, false);
  const Tensor projection = two_cameras().to(torch::kFloat32);
  const auto changed = [&](Tensor Splats::*member, const Tensor& value) {
    Splats other = s;
    other.*member = value;
    return other;
  };
  EXPECT_THROW(draw_splats(changed(&Splats::positions, Tensor()), projection, 8, 8), UsageError);
  EXPECT_THROW(draw_splats(changed(&Splats::rotations, s.rotations.narrow(2, 0, 3)), projection, 8, 8), UsageError);
  EXPECT_THROW(draw_splats(changed(&Splats::opacities, s.opacities.to(torch::kFloat64)), projection, 8, 8), UsageError);
  EXPECT_THROW(draw_splats(changed(&Splats::harmonics, torch::zeros({1, 5, 2, 3})), projection, 8, 8), UsageError);
  EXPECT_THROW(draw_splats(s, projection.narrow(2, 0, 2), 8, 8), UsageError);
  EXPECT_THROW(draw_splats(s, projection, 0, 8), UsageError);
  EXPECT_THROW(draw_splats(s, projection, 8, 8, {0.0f, false, false}), UsageError);
}

TEST(ViewHarmonics, HaveTheOrderAndTheSignsOfThePublishedCode) {
  // At (2, 1, 2) / 3, with the polynomials of degree 1 to 3 that files of 3D Gaussian splatting assume.
  const double x = 2.0 / 3, y = 1.0 / 3, z = 2.0 / 3;
  const double expected[] = {0.28209479,
                             -0.48860251 * y,
                             0.48860251 * z,
                             -0.48860251 * x,
                             1.09254843 * x * y,
                             -1.09254843 * y * z,
                             0.31539157 * (2 * z * z - x * x - y * y),
                             -1.09254843 * x * z,
                             0.54627422 * (x * x - y * y),
                             -0.59004359 * y * (3 * x * x - y * y)};
  const Tensor found = view_harmonics(torch::tensor({x, y, z}, torch::kFloat64), 16);
  for (int k = 0; k < 10; ++k) EXPECT_NEAR(found[k].item<double>(), expected[k], 1e-7) << k;
}

TEST(ViewHarmonics, AreOrthonormalOnTheSphere) {
  constexpr int kRings = 64, kColumns = 16;
  std::vector<Tensor> directions;
  Tensor sum = torch::zeros({16, 16}, torch::kFloat64);
  for (int r = 0; r < kRings; ++r) {
    const double z = -1.0 + (2.0 * r + 1.0) / kRings, radius = std::sqrt(1.0 - z * z);
    for (int c = 0; c < kColumns; ++c) {
      const double phi = 2.0 * M_PI * c / kColumns;
      const Tensor d = torch::tensor({radius * std::cos(phi), radius * std::sin(phi), z}, torch::kFloat64);
      const Tensor y = view_harmonics(d, 16);
      sum += torch::outer(y, y) * (4.0 * M_PI / (kRings * kColumns));
    }
  }
  // The midpoint rule along z has an error of order 1 / kRings^2.
  EXPECT_TRUE(test::is_near(sum, torch::eye(16, torch::kFloat64), 20.0 / (kRings * kRings)));
}

}  // namespace
}  // namespace doppel::splats_test
