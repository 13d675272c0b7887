#include "doppel/render/outline/boundary.h"

#include <ATen/Parallel.h>
#include <gtest/gtest.h>
#include <torch/types.h>

#include "doppel/core/error.h"
#include "doppel/render/projection.h"
#include "doppel/render/raster/rasterizer.h"
#include "render/scenes.h"
#include "support/gradient_check.h"

namespace doppel::boundary_test {
namespace {

using torch::Tensor;

using Scene = test::SphereViews;
constexpr std::int64_t kSize = Scene::kSize;

TEST(BoundaryAgrees, WithTheDefinitionOnTheCoverageMask) {
  const Scene s;
  Rasterizer rasterizer(s.mesh.faces);
  const Tensor mask = rasterizer.coverage_projected(s.vertices, s.projection, kSize, kSize);
  const Tensor pixels = project(s.vertices, s.projection);
  const Tensor boundary = boundary_vertices(s.vertices, s.projection, s.mesh.faces, kSize, kSize);
  std::int64_t count = 0;
  for (std::int64_t b = 0; b < 2; ++b) {
    for (std::int64_t c = 0; c < 3; ++c) {
      for (std::int64_t i = 0; i < s.vertices.size(1); ++i) {
        const auto x = static_cast<std::int64_t>(pixels[b][c][i][0].item<float>());
        const auto y = static_cast<std::int64_t>(pixels[b][c][i][1].item<float>());
        bool expected = x >= 1 && y >= 1 && x < kSize - 1 && y < kSize - 1;
        if (expected) expected = mask[b][c].slice(0, y - 1, y + 2).slice(1, x - 1, x + 2).min().item<int>() == 0;
        ASSERT_EQ(boundary[b][c][i].item<bool>(), expected) << b << " " << c << " " << i;
        count += expected;
      }
    }
  }
  EXPECT_GT(count, 60);
  EXPECT_LT(count, 6 * s.vertices.size(1) / 2);
}

TEST(BoundaryAgrees, ForOneTwoAndThreeThreadsAndInvalidCamerasAreEmpty) {
  const Scene s;
  const Tensor valid = torch::tensor({1, 0, 1, 1, 1, 0}).reshape({2, 3}).to(torch::kBool);
  const int before = at::get_num_threads();
  at::set_num_threads(1);
  const Tensor expected = boundary_vertices(s.vertices, s.projection, s.mesh.faces, kSize, kSize, valid);
  for (const int threads : {2, 3}) {
    at::set_num_threads(threads);
    EXPECT_TRUE(torch::equal(boundary_vertices(s.vertices, s.projection, s.mesh.faces, kSize, kSize, valid), expected));
  }
  at::set_num_threads(before);
  EXPECT_TRUE(torch::equal(expected.any(2), valid));
}

TEST(BoundaryVisibility, HidesWhatLiesBehindButKeepsTheOutline) {
  // A square plate hides a smaller one 0.5 m behind it, except where that sticks out on the right.
  const Tensor front =
      torch::tensor({-0.5f, -0.5f, 2.f, 0.5f, -0.5f, 2.f, 0.5f, 0.5f, 2.f, -0.5f, 0.5f, 2.f}).reshape({4, 3});
  const Tensor back = front * torch::tensor({1.2f, 1.24f, 1.25f});
  const Tensor vertices = torch::cat({front, back}).unsqueeze(0);
  const Tensor faces = torch::tensor({0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7}, torch::kInt32).reshape({4, 3});
  const Tensor projection =
      torch::tensor({60.f, 0.f, 32.f, 0.f, 0.f, 60.f, 32.f, 0.f, 0.f, 0.f, 1.f, 0.f}).reshape({1, 1, 3, 4});
  const Tensor all = boundary_vertices(vertices, projection, faces, 64, 64)[0][0];
  EXPECT_TRUE(all.all().item<bool>());
  BoundaryOptions options;
  options.visible_only = true;
  const Tensor seen = boundary_vertices(vertices, projection, faces, 64, 64, {}, options)[0][0];
  EXPECT_TRUE(seen.slice(0, 0, 4).all().item<bool>());
  EXPECT_FALSE(seen.slice(0, 4, 8).any().item<bool>());
}

TEST(BoundarySizes, EmptyBatchAndNoFaces) {
  const Scene s;
  EXPECT_EQ(
      boundary_vertices(torch::zeros({0, 5, 3}), torch::zeros({0, 2, 3, 4}), torch::zeros({0, 3}, torch::kInt32), 9, 9)
          .sizes(),
      (std::vector<std::int64_t>{0, 2, 5}));
  const Tensor none = boundary_vertices(s.vertices, s.projection, torch::zeros({0, 3}, torch::kInt32), kSize, kSize);
  EXPECT_TRUE(
      none.all(2).all().item<bool>());  // nothing is covered, so every vertex in the image borders on background
}

TEST(BoundaryRejects, WrongShapes) {
  const Scene s;
  EXPECT_THROW(boundary_vertices(s.mesh.vertices, s.projection, s.mesh.faces, 9, 9), Error);
  EXPECT_THROW(boundary_vertices(s.vertices, s.projection[0], s.mesh.faces, 9, 9), Error);
  EXPECT_THROW(boundary_vertices(s.vertices.slice(1, 0, 9), s.projection, s.mesh.faces, 9, 9), Error);
  EXPECT_THROW(boundary_vertices(s.vertices, s.projection, s.mesh.faces, 9, 9, torch::ones({2, 2}, torch::kBool)),
               Error);
}

TEST(ProjectionGradient, MatchesCentralDifferences) {
  const Scene s;
  EXPECT_TRUE(test::gradients_match(
      [](const std::vector<Tensor>& in) { return project(in[0], in[1]); },
      {{"points", s.vertices.slice(1, 0, 7).to(torch::kFloat64)}, {"projection", s.projection.to(torch::kFloat64)}}));
}

TEST(ProjectionAgrees, WithTheCameraClass) {
  PinholeCamera camera;
  camera.width = 640, camera.height = 480;
  camera.K << 500, 0, 320, 0, 510, 240, 0, 0, 1;
  camera.R << 0, 0, -1, 0, -1, 0, -1, 0, 0;
  camera.t << 0.1, 0.2, 3;
  const Tensor point = torch::tensor({0.3, -0.2, 0.4}, torch::kFloat64);
  const Eigen::Vector3d in_camera = camera.R * Eigen::Vector3d(0.3, -0.2, 0.4) + camera.t;
  const Tensor moved = camera_from_world(point.reshape({1, 3}), {camera});
  EXPECT_TRUE(test::is_near(moved.flatten(),
                            torch::tensor({in_camera.x(), in_camera.y(), in_camera.z()}, torch::kFloat64), 1e-12));
  const double u = 500 * in_camera.x() / in_camera.z() + 320, v = 510 * in_camera.y() / in_camera.z() + 240;
  Eigen::Matrix<double, 3, 4> rt;
  rt << camera.R, camera.t;
  const Eigen::Matrix<double, 4, 3> columns = (camera.K * rt).transpose();
  const Tensor p = torch::from_blob(const_cast<double*>(columns.data()), {1, 1, 3, 4}, torch::kFloat64).clone();
  EXPECT_TRUE(
      test::is_near(project(point.reshape({1, 1, 3}), p).flatten(), torch::tensor({u, v}, torch::kFloat64), 1e-9));
}

}  // namespace
}  // namespace doppel::boundary_test
