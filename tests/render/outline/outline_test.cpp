#include "doppel/render/outline/outline.h"

#include <ATen/Parallel.h>
#include <gtest/gtest.h>
#include <torch/types.h>

#include <set>

#include "doppel/core/error.h"
#include "doppel/render/projection.h"
#include "doppel/render/raster/rasterizer.h"
#include "render/scenes.h"

namespace doppel::outline_test {
namespace {

using torch::Tensor;

constexpr std::int64_t kSize = test::SphereViews::kSize;

struct Scene : test::SphereViews {
  OutlinePoints points(const Tensor& valid = {}) const {
    return outline_points(vertices, projection, mesh.faces, kSize, kSize, valid);
  }
};

TEST(OutlineAgrees, WithTheEdgePixelsOfTheCoverageMask) {
  const Scene s;
  const OutlinePoints found = s.points();
  Rasterizer rasterizer(s.mesh.faces);
  const Tensor mask = rasterizer.coverage_projected(s.vertices, s.projection, kSize, kSize);
  for (std::int64_t v = 0; v < 6; ++v) {
    const Tensor one = mask.flatten(0, 1)[v];
    std::set<std::pair<std::int64_t, std::int64_t>> expected, seen;
    for (std::int64_t y = 2; y < kSize - 2; ++y)
      for (std::int64_t x = 2; x < kSize - 2; ++x)
        if (one[y][x].item<int>() && !(one[y][x - 1].item<int>() && one[y][x + 1].item<int>() &&
                                       one[y - 1][x].item<int>() && one[y + 1][x].item<int>()))
          expected.insert({x, y});
    ASSERT_GT(expected.size(), 60u);
    for (std::int64_t i = 0; i < found.used.size(1); ++i) {
      if (!found.used[v][i].item<bool>()) continue;
      const Tensor corners = s.vertices[v / 3].index_select(0, found.corners[v][i]);
      const Tensor point = (corners * found.barycentrics[v][i].unsqueeze(1)).sum(0);
      const Tensor pixel = project(point.view({1, 1, 3}), s.projection[v / 3].slice(0, v % 3, v % 3 + 1).unsqueeze(0));
      const double x = pixel.flatten()[0].item<double>() - 0.5, y = pixel.flatten()[1].item<double>() - 0.5;
      EXPECT_NEAR(x, std::round(x), 2e-2) << "the surface is seen at the pixel's centre";
      EXPECT_NEAR(y, std::round(y), 2e-2);
      seen.insert({std::llround(x), std::llround(y)});
    }
    EXPECT_EQ(seen, expected) << "view " << v;
  }
}

TEST(OutlineAgrees, ForOneTwoAndThreeThreadsAndInvalidViewsAreEmpty) {
  const Scene s;
  const Tensor valid = torch::tensor({1, 0, 1, 1, 1, 0}).reshape({2, 3}).to(torch::kBool);
  const int before = at::get_num_threads();
  at::set_num_threads(1);
  const OutlinePoints expected = s.points(valid);
  for (const int threads : {2, 3}) {
    at::set_num_threads(threads);
    const OutlinePoints found = s.points(valid);
    EXPECT_TRUE(torch::equal(found.corners, expected.corners));
    EXPECT_TRUE(torch::equal(found.barycentrics, expected.barycentrics));
    EXPECT_TRUE(torch::equal(found.used, expected.used));
  }
  at::set_num_threads(before);
  EXPECT_TRUE(torch::equal(expected.used.any(1), valid.flatten()));
}

TEST(OutlineRejects, WrongShapesAndFacesOfOtherMeshes) {
  const Scene s;
  EXPECT_THROW(outline_points(s.vertices[0], s.projection, s.mesh.faces, kSize, kSize), Error);
  EXPECT_THROW(outline_points(s.vertices, s.projection[0], s.mesh.faces, kSize, kSize), Error);
  EXPECT_THROW(outline_points(s.vertices.slice(1, 0, 5), s.projection, s.mesh.faces, kSize, kSize), Error);
  EXPECT_THROW(outline_points(s.vertices, s.projection, s.mesh.faces, 0, kSize), Error);
  EXPECT_THROW(s.points(torch::ones({4}, torch::kBool)), Error);
}

}  // namespace
}  // namespace doppel::outline_test
