#include "doppel/rigging/joints/lone_triangles.h"

#include <gtest/gtest.h>

#include "doppel/rigging/weights/bend_report.h"
#include "rigging/bent_arm.h"

namespace doppel::lone_triangles_test {
namespace {

using support::BentArm;

int lone(const Character& character) {
  int most = 0;
  for (const PoseBend& bend : examine_bending(character).poses) most = std::max(most, bend.stretched_alone);
  return most;
}

/// An arm with one vertex of the forearm that the upper arm moves.
class ATornArm : public ::testing::Test {
 protected:
  ATornArm() {
    arm_.field.row(kTorn).setZero();
    arm_.field(kTorn, arm_.bone("LeftArm")) = 1.0F;
    arm_.set_skin();
  }
  static constexpr int kTorn = 38 * support::kTubeCorners + 5;
  BentArm arm_{0.0};
};

TEST_F(ATornArm, IsSmoothedWhereItIsTorn) {
  ASSERT_GT(lone(arm_.character), 0);
  const SkinningWeights before = arm_.character.skin;
  set_smooth_skin(arm_.character, arm_.field);
  EXPECT_EQ(lone(arm_.character), 0);
  // Far from the torn vertex nothing changes.
  for (int v = 0; v < 20 * support::kTubeCorners; ++v) {
    const auto row = arm_.character.skin.vertex_bones.row_of(arm_.character.skin.weights, v);
    const auto old = before.vertex_bones.row_of(before.weights, v);
    EXPECT_TRUE(std::equal(row.begin(), row.end(), old.begin(), old.end())) << v;
  }
}

TEST_F(ATornArm, KeepsEqualWeightsAtOnePosition) {
  // A seam: some triangles at the torn vertex have a copy of it.
  TriangleMesh& mesh = arm_.character.mesh;
  const int copy = mesh.num_vertices();
  mesh.vertices.push_back(mesh.vertices[kTorn]);
  int copied = 0;
  for (Triangle& face : mesh.faces)
    for (int& v : face)
      if (v == kTorn && copied++ < 3) v = copy;
  arm_.field.conservativeResize(copy + 1, Eigen::NoChange);
  arm_.field.row(copy) = arm_.field.row(kTorn);
  set_smooth_skin(arm_.character, arm_.field);
  const auto& skin = arm_.character.skin;
  const auto row = skin.vertex_bones.row_of(skin.weights, copy), twin = skin.vertex_bones.row_of(skin.weights, kTorn);
  EXPECT_TRUE(std::equal(row.begin(), row.end(), twin.begin(), twin.end()));
  EXPECT_GT(row.size(), 1u);
}

TEST(SmoothSkin, WithoutLoneTrianglesIsTheField) {
  BentArm arm(0.0);
  ASSERT_EQ(lone(arm.character), 0);
  const SkinningWeights before = arm.character.skin;
  set_smooth_skin(arm.character, arm.field);
  EXPECT_EQ(arm.character.skin.weights, before.weights);
  EXPECT_EQ(arm.character.skin.vertex_bones.items, before.vertex_bones.items);
}

}  // namespace
}  // namespace doppel::lone_triangles_test
