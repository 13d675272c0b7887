#include "doppel/character/blend_skin.h"

#include <gtest/gtest.h>

#include "support/test_character.h"

namespace doppel::blend_skin_test {
namespace {

using Eigen::Affine3d;
using Eigen::AngleAxisd;
using Eigen::Vector3d;

constexpr SkinningMode kBothModes[] = {SkinningMode::dual_quaternion, SkinningMode::linear};
const std::vector<int> kTwoBones{0, 1};
const std::vector<double> kHalves{0.5, 0.5};

Affine3d turn_about(const Vector3d& axis, double angle, const Vector3d& through = Vector3d::Zero()) {
  return Eigen::Translation3d(through) * AngleAxisd(angle, axis) * Eigen::Translation3d(-through);
}

TEST(BlendSkin, TheRestPoseMovesNothing) {
  Character character = make_test_character(4);
  for (const SkinningMode mode : kBothModes) {
    character.skinning = mode;
    const std::vector<Vector3d> posed = posed_vertices(character, character.rest_dofs);
    ASSERT_EQ(posed.size(), character.mesh.vertices.size());
    for (std::size_t v = 0; v < posed.size(); ++v) EXPECT_LT((posed[v] - character.mesh.vertices[v]).norm(), 1e-12);
  }
}

TEST(BlendSkin, BonesThatMoveAlikeMoveTheirSkinRigidly) {
  const Affine3d motion = Eigen::Translation3d(0.3, -0.2, 1.0) * AngleAxisd(2.5, Vector3d(1, 2, -1).normalized());
  const Vector3d point(0.4, 0.1, -0.3);
  for (const SkinningMode mode : kBothModes) {
    const SkinBlend blend({motion, motion}, mode);
    EXPECT_LT((blend.point(point, kTwoBones, kHalves) - motion * point).norm(), 1e-12);
  }
}

TEST(BlendSkin, DualQuaternionsHalveATurnAboutAnyPosition) {
  const Vector3d axis = Vector3d(0, 1, 2).normalized(), joint(0.1, 0.5, -0.2), point(0.4, 0.7, 0.1);
  for (const double angle : {0.5, 2.0, 3.0}) {
    const SkinBlend blend({Affine3d::Identity(), turn_about(axis, angle, joint)}, SkinningMode::dual_quaternion);
    EXPECT_LT((blend.point(point, kTwoBones, kHalves) - turn_about(axis, angle / 2, joint) * point).norm(), 1e-12);
  }
}

TEST(BlendSkin, DualQuaternionsTurnTheShorterWay) {
  const Affine3d first = turn_about(Vector3d::UnitZ(), -2.8), second = turn_about(Vector3d::UnitZ(), 2.8);
  const SkinBlend blend({first, second}, SkinningMode::dual_quaternion);
  const Vector3d point(1, 0, 0);
  EXPECT_LT((blend.point(point, kTwoBones, kHalves) - turn_about(Vector3d::UnitZ(), M_PI) * point).norm(), 1e-12);
}

TEST(BlendSkin, LinearSkinningAveragesPositions) {
  const Affine3d turned = turn_about(Vector3d::UnitZ(), M_PI);
  const SkinBlend blend({Affine3d::Identity(), turned}, SkinningMode::linear);
  EXPECT_LT(blend.point({1, 0, 0}, kTwoBones, kHalves).norm(), 1e-12) << "the skin collapses to the axis";
  const std::vector<double> weights{0.75, 0.25};
  EXPECT_LT((blend.point({1, 0, 2}, kTwoBones, weights) - Vector3d(0.5, 0, 2)).norm(), 1e-12);
}

}  // namespace
}  // namespace doppel::blend_skin_test
