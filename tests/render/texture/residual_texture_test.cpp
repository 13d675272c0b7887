#include "doppel/render/texture/residual_texture.h"

#include <gtest/gtest.h>

#include "doppel/core/error.h"
#include "doppel/render/lighting/sh_lighting.h"
#include "support/gradient_check.h"

namespace doppel::residual_texture_test {
namespace {

using torch::Tensor;

struct Maps {
  Tensor residual, albedo, normals, lighting;
};

Maps random_maps(int64_t batch, int64_t size) {
  auto generator = at::detail::createCPUGenerator(3);
  Maps maps;
  maps.residual = torch::randn({batch, 3, size, size}, generator) * 3.0;
  maps.albedo = torch::rand({1, 3, size, size}, generator);
  maps.normals = torch::randn({batch, 9, size, size}, generator).narrow(1, 3, 3);
  maps.normals = maps.normals / maps.normals.norm(2, 1, true);
  maps.lighting = identity_lighting() + 0.2 * torch::randn({3, kShBasis}, generator);
  return maps;
}

TEST(ResidualTextureAgrees, WithItsReference) {
  for (const int64_t size : {1, 16, 33}) {
    Maps m = random_maps(2, size);
    m.residual.flatten()[0] = 200.0;
    m.residual.flatten()[1] = -200.0;
    m.residual.flatten()[2] = 0.0;
    EXPECT_TRUE(test::is_near(residual_texture(m.residual, m.albedo, m.normals, m.lighting),
                              residual_texture_reference(m.residual, m.albedo, m.normals, m.lighting), 2e-6));
    EXPECT_TRUE(test::is_near(residual_texture(m.residual, m.albedo, {}, {}),
                              residual_texture_reference(m.residual, m.albedo, {}, {}), 2e-6));
  }
}

TEST(ResidualTextureReference, AddsToTheLitAlbedoWithinTheRange) {
  const Tensor residual = torch::tensor({0.0, 10.0, -10.0}).view({1, 3, 1, 1}), albedo = torch::full({1, 3, 1, 1}, 0.4);
  const Tensor up = torch::tensor({0.0, 1.0, 0.0}).view({1, 3, 1, 1});
  Tensor lighting = identity_lighting();
  lighting[0][1] = 0.5;  // red from above
  const Tensor expected = torch::tensor({0.6, 1.0, 0.0}).view({1, 1, 1, 3});
  EXPECT_TRUE(test::is_near(residual_texture_reference(residual, albedo, up, lighting), expected, 1e-6));
}

TEST(DetailedTextureReference, OfTheSameSizeIsTheResidualTexture) {
  const Maps m = random_maps(2, 16);
  EXPECT_TRUE(test::is_near(detailed_texture(m.residual, m.albedo, m.normals, m.lighting),
                            residual_texture_reference(m.residual, m.albedo, m.normals, m.lighting), 2e-6));
  EXPECT_TRUE(test::is_near(detailed_texture(m.residual, m.albedo, {}, {}),
                            residual_texture_reference(m.residual, m.albedo, {}, {}), 2e-6));
}

TEST(DetailedTextureReference, KeepsTheTexelsOfTheLargerTexture) {
  const Tensor albedo = random_maps(1, 32).albedo * 0.2 + 0.3, residual = torch::full({2, 3, 8, 8}, 0.1);
  const Tensor up = torch::tensor({0.0, 1.0, 0.0}).view({1, 3, 1, 1}).expand({2, 3, 8, 8});
  Tensor lighting = identity_lighting();
  lighting.select(1, 1).fill_(0.5);  // from above
  const Tensor expected = (albedo * 1.5 + std::tanh(0.1)).permute({0, 2, 3, 1}).expand({2, 32, 32, 3});
  EXPECT_TRUE(test::is_near(detailed_texture(residual, albedo, up, lighting), expected, 1e-6));
}

TEST(DetailedTextureReference, BordersOfChartsHaveTheLightOfTheirInside) {
  const Tensor albedo = torch::full({1, 3, 32, 32}, 0.4), residual = torch::zeros({1, 3, 8, 8});
  Tensor normals = torch::zeros({1, 3, 8, 8});
  normals.narrow(3, 0, 4).select(1, 1).fill_(1.0);  // the chart is the left half
  Tensor lighting = identity_lighting();
  lighting.select(1, 1).fill_(0.5);
  const Tensor chart = detailed_texture(residual, albedo, normals, lighting).narrow(2, 0, 16);
  EXPECT_TRUE(test::is_near(chart, torch::full({1, 32, 16, 3}, 0.6), 1e-6));
}

TEST(DetailedTextureGradient, AgreesWithCentralDifferences) {
  const Maps m = random_maps(1, 4);
  const Tensor albedo = random_maps(1, 16).albedo.to(torch::kFloat64) * 0.2 + 0.3,
               normals = m.normals.to(torch::kFloat64), lighting = identity_lighting().to(torch::kFloat64);
  const auto texture = [&](const std::vector<Tensor>& in) {
    return detailed_texture(in[0], albedo, normals, lighting);
  };
  EXPECT_TRUE(test::gradients_match(texture, {{"residual", m.residual.to(torch::kFloat64) * 0.02}}));
}

TEST(ResidualTextureRejects, MapsThatDoNotFit) {
  const Maps m = random_maps(2, 8);
  EXPECT_THROW(residual_texture(m.residual, m.albedo.narrow(2, 0, 4), m.normals, m.lighting), Error);
  EXPECT_THROW(residual_texture(m.residual, m.albedo, m.normals, m.lighting.narrow(0, 0, 2)), Error);
}

}  // namespace
}  // namespace doppel::residual_texture_test
