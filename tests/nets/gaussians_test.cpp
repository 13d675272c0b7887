#include "doppel/nets/gaussians.h"

#include <gtest/gtest.h>

#include "doppel/render/lighting/sh_lighting.h"
#include "support/gradient_check.h"

namespace doppel::gaussians_test {
namespace {

using torch::Tensor;

constexpr std::int64_t kSize = 16;

/// A square of one metre in the plane y = 0, whose UVs fill the map.
struct Square {
  Tensor vertices =
      torch::tensor({0.0f, 0.0f, 0.0f, 1.0f, 0.0f, 0.0f, 1.0f, 0.0f, -1.0f, 0.0f, 0.0f, -1.0f}).view({4, 3});
  RenderMesh mesh = RenderMesh(
      torch::tensor({0, 1, 2, 0, 2, 3}, torch::kInt32).view({2, 3}),
      torch::tensor({0.0f, 0.0f, 1.0f, 0.0f, 1.0f, 1.0f, 0.0f, 0.0f, 1.0f, 1.0f, 0.0f, 1.0f}).view({2, 3, 2}), 4);
  TextureSpace space{mesh, kSize};
  Tensor texture = torch::full({kSize, kSize, 3}, 0.25f);
  GaussianTexels texels = gaussian_texels(vertices, space, texture);
  SurfaceFrames frames = surface_frames(vertices.unsqueeze(0), mesh, texels.points);
};

GaussiansConfig small_config(bool network) {
  GaussiansConfig config;
  config.size = kSize;
  config.network = network;
  config.levels = 2;
  config.unet.width = 0.25;
  config.unet.dropout = 0.0;
  return config;
}

TexNetInput some_maps() {
  auto generator = at::detail::createCPUGenerator(2);
  return texnet_input(torch::randn({1, 9, kSize, kSize}, generator), torch::ones({1, 3}),
                      torch::tensor({0.0f, 0.0f, 1.0f}).view({1, 3}));
}

TEST(GaussianTexels, HaveTheSpacingOfTheMapOnTheSurface) {
  const Square square;
  ASSERT_EQ(square.texels.points.texel.size(0), kSize * kSize);
  EXPECT_TRUE(test::is_near(square.texels.spacing, torch::full({kSize * kSize}, 1.0 / kSize), 1e-5));
  EXPECT_TRUE(test::is_near(square.texels.colours, torch::full({kSize * kSize, 3}, 0.25), 1e-6));
}

TEST(Gaussians, BeginOnTheSurfaceWithItsColours) {
  const Square square;
  Gaussians gaussians(small_config(false), square.texels, Tensor());
  const Splats s = gaussians->forward(square.frames, std::nullopt);
  EXPECT_TRUE(test::is_near(s.positions, square.frames.positions, 1e-6));
  EXPECT_TRUE(test::is_near(s.opacities.sigmoid(), torch::full_like(s.opacities, 0.9), 1e-5));
  EXPECT_TRUE(test::is_near(s.harmonics.squeeze(2) * 0.28209479 + 0.5, torch::full_like(s.positions, 0.25), 1e-5));
  EXPECT_NEAR(s.log_scales.exp()[0][0][0].item<double>(), 0.7 / kSize, 1e-5);
  EXPECT_NEAR(s.log_scales.exp()[0][0][2].item<double>(), 0.3 * 0.7 / kSize, 1e-5);
  EXPECT_NEAR(gaussians->offset_length().item<double>(), 0.0, 1e-4);
  EXPECT_NEAR(gaussians->excess_scale(3.0).item<double>(), 0.0, 1e-6);
  EXPECT_GT(gaussians->excess_scale(0.5).item<double>(), 0.0);
}

TEST(Gaussians, CarryTheNormalsOfTheirTexelsOnlyWithCull) {
  const Square square;
  GaussiansConfig config = small_config(false);
  EXPECT_FALSE(Gaussians(config, square.texels, Tensor())->forward(square.frames, std::nullopt).normals.defined());
  config.cull = true;
  const Splats s = Gaussians(config, square.texels, Tensor())->forward(square.frames, std::nullopt);
  EXPECT_TRUE(torch::equal(s.normals, square.frames.normals));
}

TEST(Gaussians, TakeTheLightAtTheNormal) {
  const Square square;  // its normal is up
  GaussiansConfig config = small_config(false);
  config.lit = true;
  Tensor lighting = identity_lighting();
  lighting.select(1, 1).fill_(0.5);  // from above
  Gaussians gaussians(config, square.texels, lighting);
  const Splats s = gaussians->forward(square.frames, std::nullopt);
  EXPECT_TRUE(test::is_near(s.harmonics.squeeze(2) * 0.28209479 + 0.5, torch::full_like(s.positions, 0.375), 1e-5));
}

/// Three tenths of the light are taken from above.
Occlusion some_occlusion(const Square& square) { return {torch::full({1, kSize * kSize}, 0.3), square.frames.normals}; }

TEST(Gaussians, AreShadedByTheOcclusion) {
  const Square square;
  GaussiansConfig config = small_config(false);
  config.lit = config.shadows = true;
  Gaussians gaussians(config, square.texels, identity_lighting());
  const auto colours = [&](const Occlusion& occlusion) {
    return gaussians->forward(square.frames, std::nullopt, std::nullopt, {}, occlusion).harmonics * 0.28209479 + 0.5;
  };
  EXPECT_TRUE(test::is_near(colours(some_occlusion(square)), 0.7 * colours({}), 1e-5));
}

TEST(Gaussians, NetworkChangesAllParametersButTheRotations) {
  const Square square;
  Gaussians gaussians(small_config(true), square.texels, Tensor());
  gaussians->eval();
  const Splats shared = gaussians->forward(square.frames, std::nullopt),
               posed = gaussians->forward(square.frames, some_maps());
  EXPECT_FALSE(posed.positions.equal(shared.positions));
  EXPECT_FALSE(posed.log_scales.equal(shared.log_scales));
  EXPECT_FALSE(posed.opacities.equal(shared.opacities));
  EXPECT_FALSE(posed.harmonics.equal(shared.harmonics));
  EXPECT_TRUE(posed.rotations.equal(shared.rotations));
  EXPECT_LT((posed.positions - square.frames.positions).norm(2, 2).max().item<double>(), 0.03 * std::sqrt(3.0));
}

TEST(Gaussians, EveryParameterGetsAGradient) {
  const Square square;
  GaussiansConfig config = small_config(true);
  config.lit = config.shadows = true;
  Gaussians gaussians(config, square.texels, identity_lighting());
  const Splats s =
      gaussians->forward(square.frames, some_maps(), at::detail::createCPUGenerator(1), {}, some_occlusion(square));
  const Tensor camera = torch::tensor({40.0f, 0.0f, -16.0f, 32.0f, 0.0f, 0.0f, -56.0f, 32.0f, 0.0f, -1.0f, 0.0f, 2.0f});
  const SplatImage image = draw_splats(s, camera.view({1, 1, 3, 4}), 32, 32);
  ASSERT_GT(image.alpha.max().item<double>(), 0.5);
  image.colour.square().sum().backward();
  for (const auto& parameter : gaussians->named_parameters()) {
    ASSERT_TRUE(parameter.value().grad().defined()) << parameter.key();
    EXPECT_TRUE(parameter.value().grad().isfinite().all().item<bool>()) << parameter.key();
    EXPECT_GT(parameter.value().grad().abs().max().item<double>(), 0.0) << parameter.key();
  }
}

}  // namespace
}  // namespace doppel::gaussians_test
