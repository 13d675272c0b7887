#include "doppel/render/splats/splat_rows.h"

#include <gtest/gtest.h>

#include <cmath>

#include "doppel/core/error.h"
#include "doppel/render/splats/splats.h"

namespace doppel::splat_rows_test {
namespace {

using torch::Tensor;

/// [1,3,4]
const Tensor kCamera =
    torch::tensor({60.f, 0.f, 28.f, 70.f, 0.f, 60.f, 20.f, 50.f, 0.f, 0.f, 1.f, 2.5f}).view({1, 3, 4});

Splats random_splats(std::int64_t harmonics) {
  auto generator = at::detail::createCPUGenerator(3);
  const auto normal = [&](torch::IntArrayRef sizes) { return torch::randn(sizes, generator, torch::kFloat32); };
  return {0.3 * normal({2, 50, 3}),      normal({2, 50, 4}),
          normal({2, 50, 3}) - 3.0,      3 * normal({2, 50}),
          normal({2, 50, harmonics, 3}), {}};
}

TEST(SplatRowsReference, OneGaussianByHand) {
  Splats splats;
  splats.positions = torch::tensor({1.f, 2.f, 3.f}).view({1, 1, 3});
  splats.rotations = torch::tensor({0.f, 0.f, -2.f, 0.f}).view({1, 1, 4});
  splats.log_scales = torch::tensor({0.f, std::log(0.5f), std::log(0.25f)}).view({1, 1, 3});
  splats.opacities = torch::zeros({1, 1});
  splats.harmonics = torch::tensor({0.f, 1.f, -9.f}).view({1, 1, 1, 3});
  const auto green = static_cast<float>(0.5 + kFirstHarmonic);
  const Tensor expected =
      torch::tensor({1.f, 2.f, 3.f, 0.f, 0.f, -1.f, 0.f, 1.f, 0.5f, 0.25f, 0.5f, 0.5f, green, 0.f}).view({1, 1, 14});
  EXPECT_LT((splat_rows(splats, kCamera) - expected).abs().max().item<float>(), 1e-6f);
}

TEST(SplatRowsReference, TheRowsDrawTheSameImage) {
  const Tensor camera = kCamera.repeat({2, 1, 1});
  for (const std::int64_t harmonics : {1, 4, 9, 16}) {
    Splats splats = random_splats(harmonics);
    splats.normals = splats.positions;  // half of them face away
    const SplatImage direct = draw_splats(splats, camera.unsqueeze(1), 40, 56),
                     through = draw_splats(splats_of_rows(splat_rows(splats, camera)), camera.unsqueeze(1), 40, 56);
    EXPECT_GT(direct.alpha.max().item<float>(), 0.5f);
    EXPECT_LT((direct.colour - through.colour).abs().max().item<float>(), 1e-4f) << harmonics;
    EXPECT_LT((direct.alpha - through.alpha).abs().max().item<float>(), 1e-4f) << harmonics;
  }
}

TEST(SplatRowsReference, ExtremeOpacitiesAndScalesStayFinite) {
  Splats splats = random_splats(1);
  splats.opacities.fill_(40.0);
  splats.log_scales.fill_(-200.0);
  const Splats back = splats_of_rows(splat_rows(splats, kCamera.repeat({2, 1, 1})));
  EXPECT_TRUE(back.opacities.isfinite().all().item<bool>());
  EXPECT_TRUE(back.log_scales.isfinite().all().item<bool>());
}

TEST(SplatRowsRejects, OtherShapes) {
  EXPECT_THROW(splat_rows(random_splats(1), kCamera), UsageError);
  EXPECT_THROW(splats_of_rows(torch::zeros({1, 5, 13})), UsageError);
  EXPECT_THROW(splats_of_rows(torch::zeros({5, 14})), UsageError);
}

}  // namespace
}  // namespace doppel::splat_rows_test
