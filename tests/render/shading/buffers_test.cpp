#include "doppel/render/shading/buffers.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/types.h>

#include "doppel/core/error.h"
#include "doppel/render/lighting/sh_lighting.h"
#include "doppel/render/projection.h"
#include "render/shading_scene.h"
#include "support/gradient_check.h"
#include "support/message_of.h"

namespace doppel::buffers_test {
namespace {

using test::ShadingScene;
using testing::HasSubstr;
using torch::Tensor;

struct Fixture {
  ShadingScene s = test::shading_scene(2, 2, 60, 50, 10).to(torch::kFloat32);
  RenderScene scene{s.vertices, s.projection, s.texture, s.lighting};
  Tensor draw(RenderMode mode) const { return render_mode(scene, s.mesh, s.height, s.width, mode); }
};

TEST(Buffers, ColourIsAlbedoTimesShading) {
  const Fixture f;
  const Tensor colour = f.draw(RenderMode::colour);
  EXPECT_EQ(colour.sizes(), (std::vector<std::int64_t>{2, 2, 60, 50, 3}));
  EXPECT_TRUE(test::is_near(f.draw(RenderMode::albedo) * f.draw(RenderMode::shading), colour, 1e-5));
  EXPECT_GT(colour.abs().sum().item<float>(), 10);
  RenderScene unlit = f.scene;
  unlit.lighting = Tensor();
  EXPECT_TRUE(torch::equal(render_mode(unlit, f.s.mesh, 60, 50, RenderMode::colour), f.draw(RenderMode::albedo)));
}

TEST(Buffers, ShadingIsTheLightOnTheNormals) {
  const Fixture f;
  const Tensor basis = sh_basis(f.draw(RenderMode::normal));
  const Tensor expected =
      torch::matmul(f.s.lighting.reshape({2, 2, 1, 3, 9}).unsqueeze(2), basis.unsqueeze(5)).squeeze(5);
  const Tensor mask = f.draw(RenderMode::mask);
  EXPECT_TRUE(test::is_near(f.draw(RenderMode::shading), expected * mask, 2e-3));
}

TEST(Buffers, PositionsLieOnTheRayAtTheDepth) {
  const Fixture f;
  const Tensor position = f.draw(RenderMode::position), depth = f.draw(RenderMode::depth).squeeze(4);
  const Tensor mask = f.draw(RenderMode::mask).squeeze(4);
  for (int b = 0; b < 2; ++b) {
    for (int c = 0; c < 2; ++c) {
      const Tensor pixel =
          project(position[b][c].reshape({1, -1, 3}), f.s.projection[b][c].reshape({1, 1, 3, 4})).reshape({60, 50, 2});
      const Tensor x = (torch::arange(50, torch::kFloat32) + 0.5).reshape({1, 50}).expand({60, 50});
      const Tensor y = (torch::arange(60, torch::kFloat32) + 0.5).reshape({60, 1}).expand({60, 50});
      EXPECT_TRUE(
          test::is_near(pixel * mask[b][c].unsqueeze(2), torch::stack({x, y}, 2) * mask[b][c].unsqueeze(2), 0.01));
      const Tensor m = f.s.projection[b][c].to(torch::kFloat64);
      const Tensor centre = -torch::matmul(torch::inverse(m.slice(1, 0, 3)), m.select(1, 3));
      const Tensor expected = (position[b][c].to(torch::kFloat64) - centre).norm(2, 2) * mask[b][c];
      EXPECT_TRUE(test::is_near(depth[b][c], expected, 1e-4));
    }
  }
  EXPECT_GT(mask.sum().item<float>(), 500);
}

TEST(Buffers, TheAlbedoIsTheTextureAtTheUvs) {
  Fixture f;
  const int size = 256;  // a texture that shows its own coordinates
  const Tensor line = (torch::arange(size, torch::kFloat32) + 0.5) / size;
  f.scene.texture = torch::stack({line.reshape({1, size}).expand({size, size}),
                                  1 - line.reshape({size, 1}).expand({size, size}), torch::ones({size, size})},
                                 2)
                        .unsqueeze(0)
                        .contiguous();
  EXPECT_TRUE(test::is_near(f.draw(RenderMode::albedo).slice(4, 0, 2), f.draw(RenderMode::uv), 3e-3));
}

TEST(Buffers, SupersamplingAveragesAndCovers) {
  const Fixture f;
  const SupersampledImage fine = render_supersampled(f.scene, f.s.mesh, 60, 50, RenderMode::colour, 4);
  const Tensor mask = f.draw(RenderMode::mask).squeeze(4);
  EXPECT_EQ(fine.image.sizes(), (std::vector<std::int64_t>{2, 2, 60, 50, 3}));
  EXPECT_GE(fine.alpha.min().item<float>(), 0);
  EXPECT_LE(fine.alpha.max().item<float>(), 1);
  EXPECT_NEAR(fine.alpha.sum().item<float>() / mask.sum().item<float>(), 1, 0.02);
  EXPECT_GT(((fine.alpha > 0.1) & (fine.alpha < 0.9)).sum().item<int>(), 50);
  // Over its own colour a white body leaves no edge.
  RenderScene white = f.scene;
  white.texture = white.lighting = Tensor();
  const SupersampledImage body = render_supersampled(white, f.s.mesh, 60, 50, RenderMode::colour, 3);
  EXPECT_TRUE(test::is_near(body.over(torch::ones({3})), torch::ones({2, 2, 60, 50, 3}), 1e-6));
  const SupersampledImage plain = render_supersampled(f.scene, f.s.mesh, 60, 50, RenderMode::colour, 1);
  EXPECT_TRUE(torch::equal(plain.image, f.draw(RenderMode::colour)));
}

TEST(Buffers, SupersamplingIsTheMeanOfTheLargeImage) {
  const ShadingScene s = test::shading_scene(2, 2, 110, 90, 10).to(torch::kFloat32);
  RenderScene scene{s.vertices, s.projection, s.texture, s.lighting};
  for (const int factor : {1, 2, 3, 5}) {  // tiles of 64 samples end within a pixel of 3 or 5
    const SupersampledImage found = render_supersampled(scene, s.mesh, 110, 90, RenderMode::colour, factor);
    RenderScene large = scene;
    large.projection = scene.projection.clone();
    large.projection.slice(2, 0, 2).mul_(factor);
    const auto mean = [&](RenderMode mode) {
      return render_mode(large, s.mesh, 110 * factor, 90 * factor, mode)
          .view({2, 2, 110, factor, 90, factor, -1})
          .mean({3, 5});
    };
    EXPECT_TRUE(test::is_near(found.image, mean(RenderMode::colour), 1e-5)) << factor;
    EXPECT_TRUE(test::is_near(found.alpha, mean(RenderMode::mask).squeeze(4), 1e-6)) << factor;
  }
}

TEST(BuffersRejects, WhatTheSceneLacks) {
  Fixture f;
  const auto message = [&](RenderMode mode, const RenderMesh& mesh) -> std::string {
    return support::message_of<UsageError>([&] { render_mode(f.scene, mesh, 60, 50, mode); });
  };
  const RenderMesh bare(f.s.mesh.faces, {}, f.s.mesh.num_vertices);
  EXPECT_THAT(message(RenderMode::uv, bare), HasSubstr("no UVs"));
  EXPECT_THAT(message(RenderMode::albedo, bare), HasSubstr("no UVs"));
  EXPECT_EQ(message(RenderMode::depth, bare), "nothing was thrown");
  f.scene.lighting = Tensor();
  EXPECT_THAT(message(RenderMode::shading, bare), HasSubstr("needs lighting"));
  f.scene.projection = f.s.projection[0];
  EXPECT_THAT(message(RenderMode::mask, bare), HasSubstr("projection"));
  EXPECT_THROW(render_supersampled(f.scene, bare, 60, 50, RenderMode::mask, 2), UsageError);
  f.scene.projection = f.s.projection;
  EXPECT_THROW(render_supersampled(f.scene, bare, 60, 50, RenderMode::mask, 9), UsageError);
  EXPECT_THROW(render_supersampled(f.scene, bare, 9000, 50, RenderMode::mask, 2), UsageError);
}

}  // namespace
}  // namespace doppel::buffers_test
