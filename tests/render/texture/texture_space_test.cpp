#include "doppel/render/texture/texture_space.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/autograd.h>
#include <torch/csrc/jit/frontend/tracer.h>
#include <torch/csrc/jit/runtime/graph_executor.h>
#include <torch/types.h>

#include "doppel/core/error.h"
#include "doppel/render/projection.h"
#include "doppel/render/shading/shading.h"
#include "render/shading_scene.h"
#include "support/gradient_check.h"

namespace doppel::texture_space_test {
namespace {

using torch::Tensor;

/// Two triangles side by side in the map, with a gap of 0.1 between their charts.
RenderMesh two_charts() {
  const Tensor uvs = torch::tensor({0.1f, 0.1f, 0.45f, 0.1f, 0.1f, 0.9f, 0.9f, 0.1f, 0.9f, 0.9f, 0.55f, 0.9f});
  return RenderMesh(torch::tensor({0, 1, 2, 1, 3, 2}, torch::kInt32).reshape({2, 3}), uvs.reshape({2, 3, 2}), 4);
}

TEST(TextureSpace, InterpolatesAtTexelCentres) {
  const RenderMesh mesh = two_charts();
  const int size = 40;
  const TextureSpace space(mesh, size, 0);
  auto generator = at::detail::createCPUGenerator(2);
  const Tensor vertices = torch::randn({2, 4, 3}, generator, torch::kFloat64);
  const Tensor map = space.positions(vertices);
  ASSERT_EQ(map.sizes(), (std::vector<std::int64_t>{2, 3, size, size}));
  int inside = 0;
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      // Chart 0: corners (0.1, 0.1), (0.45, 0.1), (0.1, 0.9).
      const double u = (x + 0.5) / size, v = 1 - (y + 0.5) / size;
      const double w1 = (u - 0.1) / 0.35, w2 = (v - 0.1) / 0.8, w0 = 1 - w1 - w2;
      if (u > 0.5) continue;
      const bool own = w0 >= 0 && w1 >= 0 && w2 >= 0;
      if (std::min({std::abs(w0), std::abs(w1), std::abs(w2)}) < 1e-6) continue;
      ASSERT_EQ(space.mask()[y][x].item<bool>(), own) << x << " " << y;
      const Tensor expected =
          own ? w0 * vertices[1][0] + w1 * vertices[1][1] + w2 * vertices[1][2] : torch::zeros({3}, torch::kFloat64);
      ASSERT_TRUE(test::is_near(map[1].select(1, y).select(1, x), expected, 1e-6));
      inside += own;
    }
  }
  EXPECT_NEAR(inside, size * size * 0.35 * 0.8 / 2, 12);
}

TEST(TextureSpace, PadsWithTheNearestTexelOfAChart) {
  const RenderMesh mesh = two_charts();
  const int size = 32, padding = 3;
  const TextureSpace plain(mesh, size, 0), padded(mesh, size, padding);
  EXPECT_TRUE(torch::equal(plain.mask(), padded.mask()));
  const Tensor vertices = torch::rand({1, 4, 3}) + 1;
  const Tensor before = plain.positions(vertices)[0], after = padded.positions(vertices)[0];
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      int best = padding * padding + 1;
      std::vector<Tensor> candidates;
      for (int v = 0; v < size; ++v) {
        for (int u = 0; u < size; ++u) {
          const int square = (u - x) * (u - x) + (v - y) * (v - y);
          if (square > best || square > padding * padding || !plain.mask()[v][u].item<bool>()) continue;
          if (square < best) candidates.clear();
          best = square;
          candidates.push_back(before.select(1, v).select(1, u));
        }
      }
      const Tensor found = after.select(1, y).select(1, x);
      if (candidates.empty()) candidates.push_back(torch::zeros({3}));
      bool fits = false;
      for (const Tensor& c : candidates) fits = fits || torch::equal(found, c);
      ASSERT_TRUE(fits) << x << " " << y;
    }
  }
}

TEST(TextureSpace, HasUnitNormalsOfTheSurface) {
  const test::Mesh ball = test::sphere(12, 0.5f);
  const TextureSpace space(test::with_front_uvs(ball, 0.95), 64);
  const Tensor vertices =
      ball.vertices.unsqueeze(0).to(torch::kFloat64) * torch::tensor({1.0, 1.4, 0.7}, torch::kFloat64);
  const Tensor normals = space.normals(vertices);
  const Tensor length = normals.norm(2, 1)[0];
  EXPECT_TRUE(((length - 1).abs() < 1e-6).logical_or(length == 0).all().item<bool>());
  EXPECT_TRUE((length > 0.5).logical_or(space.mask().logical_not()).all().item<bool>());
  EXPECT_GT(space.mask().to(torch::kFloat32).mean().item<float>(), 0.5f);
  // The normal of an ellipsoid is its position over the squared half axes.
  const Tensor axes = torch::tensor({0.5, 0.7, 0.35}, torch::kFloat64).reshape({1, 3, 1, 1});
  const Tensor gradient = space.positions(vertices) / axes.square();
  const Tensor expected = gradient / gradient.norm(2, 1, true).clamp_min(1e-9);
  EXPECT_GT(((expected * normals).sum(1)[0] * space.mask()).sum().item<double>() / space.mask().sum().item<double>(),
            0.98);
}

TEST(TextureSpaceAgrees, NormalsOfTheKernelWithThoseOfTheReference) {
  const test::Mesh ball = test::sphere(12, 0.5f);
  Tensor vertices = ball.vertices.unsqueeze(0) * torch::rand({3, 1, 3}, at::detail::createCPUGenerator(2));
  vertices[2].zero_();  // a surface without normals
  for (const int size : {1, 7, 64, 100})
    for (const double scale : {0.5, 0.95}) {
      const TextureSpace space(test::with_front_uvs(ball, scale), size, size > 10 ? 3 : 0);
      EXPECT_TRUE(test::is_near(space.normals_without_gradient(vertices), space.normals(vertices), 1e-5)) << size;
    }
}

TEST(TextureSpaceGradient, MatchesCentralDifferences) {
  const test::Mesh ball = test::sphere(5, 0.5f);
  const TextureSpace space(test::with_front_uvs(ball, 0.9), 12);
  const Tensor vertices = ball.vertices.unsqueeze(0).to(torch::kFloat64);
  EXPECT_TRUE(test::gradients_match(
      [&](const auto& x) {
        return torch::cat({space.normals(x[0]), space.positions(x[0])}, 1);
      },
      {{"vertices", vertices}}));
}

TEST(TextureSpace, IsTraceableForAnyBatch) {
  const test::Mesh ball = test::sphere(6, 0.5f);
  const TextureSpace space(test::with_front_uvs(ball, 0.9), 20);
  const Tensor one = ball.vertices.unsqueeze(0);
  const auto trace = torch::jit::tracer::trace(
      {one}, [&](torch::jit::Stack in) { return torch::jit::Stack{space.normals(in[0].toTensor())}; },
      [](const torch::autograd::Variable&) { return std::string(); });
  torch::jit::GraphExecutor executor(trace.first->graph, "normals");
  const Tensor three = torch::cat({one, one * 1.5 + 0.1, one.flip({2})});
  torch::jit::Stack stack{three};
  executor.run(stack);
  EXPECT_TRUE(test::is_near(stack.at(0).toTensor(), space.normals(three), 1e-6));
}

TEST(TextureSpace, AgreesWithWhatTheRendererLooksUp) {
  // A wall whose texture holds positions: each pixel shows the position that it sees.
  const Tensor uvs = torch::tensor({0.1f, 0.1f, 0.9f, 0.1f, 0.9f, 0.9f, 0.1f, 0.1f, 0.9f, 0.9f, 0.1f, 0.9f});
  const RenderMesh wall(torch::tensor({0, 1, 2, 0, 2, 3}, torch::kInt32).reshape({2, 3}), uvs.reshape({2, 3, 2}), 4);
  const Tensor vertices =
      torch::tensor({-.6f, -.5f, 1.5f, .6f, -.5f, 3.f, .6f, .6f, 3.2f, -.6f, .6f, 1.7f}).reshape({1, 4, 3});
  const Tensor projection =
      torch::tensor({70.f, 4.f, 40.f, 3.f, 0.f, 66.f, 40.f, -2.f, 0.f, 0.f, 1.f, 0.1f}).reshape({1, 1, 3, 4});
  const TextureSpace space(wall, 256);
  const Tensor texture = space.positions(vertices).permute({0, 2, 3, 1}).contiguous();
  ShadingOptions options;
  options.lit = false;
  const ShadedImage image = shade(vertices, texture, {}, projection, wall, 80, 80, options);
  const Tensor pixel = project(image.colour.reshape({1, -1, 3}), projection).reshape({80, 80, 2});
  const Tensor line = torch::arange(80, torch::kFloat32) + 0.5;
  const Tensor mask = image.mask[0][0];
  ASSERT_GT(mask.sum().item<int>(), 400);
  EXPECT_LT(((pixel.select(2, 0) - line.reshape({1, 80})).abs() * mask).max().item<float>(), 0.3f);
  EXPECT_LT(((pixel.select(2, 1) - line.reshape({80, 1})).abs() * mask).max().item<float>(), 0.3f);
}

TEST(TextureSpaceRejects, MeshesWithoutUvs) {
  const test::Mesh ball = test::sphere(4, 0.5f);
  EXPECT_THROW(TextureSpace(RenderMesh(ball.faces, {}, ball.vertices.size(0)), 8), UsageError);
  const RenderMesh good = test::with_front_uvs(ball, 0.9);
  EXPECT_THROW(TextureSpace(good, 0), UsageError);
  EXPECT_THROW(TextureSpace(test::with_front_uvs(ball, 1e-7), 8), UsageError);
  EXPECT_THROW(TextureSpace(good, 8).positions(torch::zeros({1, 3, 3})), UsageError);
  EXPECT_THROW(TextureSpace(good, 8).normals(torch::zeros({3, 3})), UsageError);
}

}  // namespace
}  // namespace doppel::texture_space_test
