#include "doppel/render/splats/surface_frames.h"

#include <gtest/gtest.h>

#include "render/shading_scene.h"
#include "support/gradient_check.h"

namespace doppel::surface_frames_test {
namespace {

using torch::Tensor;

struct Surface {
  test::Mesh ball = test::sphere(9, 0.5f);
  RenderMesh mesh = test::with_front_uvs(ball, 0.7);
  Tensor vertices = ball.vertices.unsqueeze(0);
  TexelPoints points = TextureSpace(mesh, 32).points();
};

/// A turn about (1, 2, 2) / 3 by `angle`, as a quaternion.
Tensor turn(double angle) {
  const double s = std::sin(angle / 2) / 3;
  return torch::tensor({std::cos(angle / 2), s, 2 * s, 2 * s}, torch::kFloat32);
}

TEST(TexelPoints, AreThoseOfTheMapOfPositions) {
  const Surface s;
  const TextureSpace space(s.mesh, 32);
  const Tensor map = space.positions(s.vertices)[0].flatten(1).index_select(1, s.points.texel).t();
  EXPECT_TRUE(test::is_near(surface_frames(s.vertices, s.mesh, s.points).positions[0], map, 1e-6));
  EXPECT_EQ(s.points.texel.size(0), space.mask().sum().item<std::int64_t>());
}

TEST(SurfaceFrames, AreUnitRotationsWhoseThirdAxisIsTheNormal) {
  const Surface s;
  const SurfaceFrames frames = surface_frames(s.vertices, s.mesh, s.points);
  EXPECT_TRUE(test::is_near(frames.rotations.norm(2, 2), torch::ones({1, frames.rotations.size(1)}), 1e-5));
  EXPECT_TRUE(test::is_near(turned(frames.rotations, torch::tensor({0.0f, 0.0f, 1.0f})), frames.normals, 1e-5));
  // The normals of a sphere around the origin point outwards.
  const Tensor outwards = frames.positions / frames.positions.norm(2, 2, true);
  EXPECT_GT((outwards * frames.normals).sum(2).min().item<double>(), 0.95);
}

TEST(SurfaceFrames, TurnWithTheMesh) {
  const Surface s;
  const SurfaceFrames before = surface_frames(s.vertices, s.mesh, s.points);
  for (const double angle : {0.3, 1.7, 3.1}) {
    const Tensor q = turn(angle), shift = torch::tensor({0.4f, -1.0f, 2.0f});
    const Tensor moved = turned(q.expand({1, s.mesh.num_vertices, 4}), s.vertices) + shift;
    const SurfaceFrames after = surface_frames(moved, s.mesh, s.points);
    const Tensor expected = quaternion_product(q.expand_as(before.rotations), before.rotations);
    // q and -q are the same rotation.
    EXPECT_GT((expected * after.rotations).sum(2).abs().min().item<double>(), 1.0 - 1e-4) << angle;
    EXPECT_TRUE(test::is_near(after.positions, turned(q.expand_as(before.rotations), before.positions) + shift, 1e-5));
  }
}

TEST(Quaternions, ProductTurnsFirstByTheSecond) {
  const Tensor a = turn(0.7), b = torch::tensor({0.6f, 0.8f, 0.0f, 0.0f}), v = torch::tensor({0.2f, -0.5f, 1.0f});
  EXPECT_TRUE(test::is_near(turned(quaternion_product(a, b), v), turned(a, turned(b, v)), 1e-6));
}

}  // namespace
}  // namespace doppel::surface_frames_test
