#include "doppel/eval/surface_metrics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/types.h>

#include <cmath>

#include "doppel/core/error.h"
#include "support/message_of.h"

namespace doppel::surface_metrics_test {
namespace {

using support::message_of;
using torch::Tensor;

struct Mesh {
  Tensor vertices, faces;
};

/// A square of n x n cells, side 1, in the plane z = height.
Mesh square(int n, double height) {
  std::vector<float> vertices;
  std::vector<int> faces;
  for (int j = 0; j <= n; ++j)
    for (int i = 0; i <= n; ++i)
      for (double v : {static_cast<double>(i) / n, static_cast<double>(j) / n, height})
        vertices.push_back(static_cast<float>(v));
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      const int a = j * (n + 1) + i, b = a + 1, c = a + n + 1, d = c + 1;
      for (int v : {a, b, d, a, d, c}) faces.push_back(v);
    }
  return {torch::tensor(vertices).view({-1, 3}), torch::tensor(faces, torch::kInt32).view({-1, 3})};
}

/// Vertices on a sphere around the origin; poles at +-y.
Mesh sphere(int rings, int segments, double radius) {
  std::vector<float> vertices;
  std::vector<int> faces;
  for (int j = 0; j <= rings; ++j)
    for (int i = 0; i < segments; ++i) {
      const double polar = M_PI * j / rings, around = 2 * M_PI * i / segments;
      for (double v : {std::sin(polar) * std::cos(around), std::cos(polar), std::sin(polar) * std::sin(around)})
        vertices.push_back(static_cast<float>(radius * v));
    }
  for (int j = 0; j < rings; ++j)
    for (int i = 0; i < segments; ++i) {
      const int a = j * segments + i, b = j * segments + (i + 1) % segments, c = a + segments, d = b + segments;
      for (int v : {a, b, d, a, d, c}) faces.push_back(v);  // those at the poles are degenerate
    }
  return {torch::tensor(vertices).view({-1, 3}), torch::tensor(faces, torch::kInt32).view({-1, 3})};
}

TEST(SurfaceDistanceAgrees, AnyNumberOfThreads) {
  const Mesh ball = sphere(20, 40, 1.0);
  const SurfaceDistance distance(ball.vertices, ball.faces);
  const Tensor points = torch::randn({1000, 3}, at::detail::createCPUGenerator(2));
  const int before = at::get_num_threads();
  at::set_num_threads(1);
  const Tensor one = distance.distances(points);
  at::set_num_threads(3);
  EXPECT_TRUE(torch::equal(one, distance.distances(points)));
  at::set_num_threads(before);
}

// Both directions, whatever the tessellation: planes 0.25 apart.
TEST(SurfaceGapReference, ParallelSquares) {
  const Mesh a = square(3, 0.0), b = square(7, 0.25);
  const SurfaceGap gap = surface_gap(a.vertices, a.faces, b.vertices, b.faces);
  EXPECT_NEAR(gap.hausdorff, 0.25, 1e-7);
  EXPECT_NEAR(gap.mean, 0.25, 1e-7);
}

// A square of side 1 in the middle of one that is three times as large and flush with it: only the large one is far.
TEST(SurfaceGapReference, HausdorffTakesTheFartherDirection) {
  const Mesh a = square(2, 0.0), large = square(6, 0.0);
  const Tensor b = large.vertices * 3.0 - torch::tensor({1.0, 1.0, 0.0});
  const SurfaceGap gap = surface_gap(a.vertices, a.faces, b, large.faces);
  EXPECT_NEAR(gap.hausdorff, std::sqrt(2.0), 1e-6);
  EXPECT_NEAR(SurfaceDistance(b, large.faces).distances(a.vertices).max().item<double>(), 0.0, 1e-6);
}

TEST(SurfaceGapReference, ConcentricSpheres) {
  const Mesh a = sphere(60, 120, 1.0), b = sphere(60, 120, 1.1);
  const SurfaceGap gap = surface_gap(a.vertices, a.faces, b.vertices, b.faces);
  EXPECT_NEAR(gap.mean, 0.1, 1e-3);  // facets lie below the sphere by up to 1 - cos(pi / 60) = 1.4e-3
  EXPECT_NEAR(gap.hausdorff, 0.1, 2e-3);
  const SurfaceGap none = surface_gap(a.vertices, a.faces, a.vertices, a.faces);
  EXPECT_NEAR(none.hausdorff, 0.0, 1e-9);
}

TEST(SurfaceDistanceRejects, WhatIsNoMesh) {
  const Mesh a = square(1, 0.0);
  const auto complaint = [](const Tensor& vertices, const Tensor& faces) {
    return message_of<UsageError>([&] { SurfaceDistance(vertices, faces); });
  };
  EXPECT_THAT(complaint(a.vertices.to(torch::kFloat64), a.faces), testing::HasSubstr("vertices must be float32"));
  EXPECT_THAT(complaint(a.vertices, a.faces.slice(0, 0, 0)), testing::HasSubstr("at least one face"));
  EXPECT_THAT(complaint(a.vertices, a.faces + 1), testing::HasSubstr("names vertex 4, but there are 4"));
  EXPECT_THAT(message_of<UsageError>([&] { SurfaceDistance(a.vertices, a.faces).distances(a.faces); }),
              testing::HasSubstr("points must be"));
}

}  // namespace
}  // namespace doppel::surface_metrics_test
