#include "doppel/rigging/autorig/joints_from_points.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "doppel/core/error.h"

namespace doppel::joints_from_points_test {
namespace {

using Eigen::Vector3d;
using Points = std::array<std::optional<Vector3d>, kNumBodyLandmarks>;

std::size_t landmark(const std::string& name) {
  for (std::size_t k = 0; k < kBodyLandmarkNames.size(); ++k)
    if (name == kBodyLandmarkNames[k]) return k;
  ADD_FAILURE() << name;
  return 0;
}

/// A person who stands at the origin and looks along +z, with a trunk of 0.5 m.
Points standing_person() {
  Points points;
  for (const double side : {1.0, -1.0}) {
    const std::string s = side > 0 ? "left_" : "right_";
    points[landmark(s + "shoulder")] = Vector3d(0.2 * side, 1.45, 0.0);
    points[landmark(s + "elbow")] = Vector3d(0.2 * side, 1.15, 0.0);
    points[landmark(s + "wrist")] = Vector3d(0.2 * side, 0.90, 0.0);
    points[landmark(s + "hip")] = Vector3d(0.1 * side, 0.95, 0.0);
    points[landmark(s + "knee")] = Vector3d(0.1 * side, 0.5, 0.0);
    points[landmark(s + "ankle")] = Vector3d(0.1 * side, 0.12, 0.0);
    points[landmark(s + "heel")] = Vector3d(0.1 * side, 0.03, -0.05);
    points[landmark(s + "foot_index")] = Vector3d(0.1 * side, 0.03, 0.2);
  }
  return points;
}

TEST(JointsFromPoints, OffsetsFollowTheBody) {
  const BodyJoints joints = joints_from_points(standing_person());
  for (const double side : {1.0, -1.0}) {
    const std::string s = side > 0 ? "left_" : "right_";
    EXPECT_TRUE(joints.at(s + "shoulder").isApprox(Vector3d(0.2 * side, 1.42, -0.01), 1e-9));
    EXPECT_TRUE(joints.at(s + "hip").isApprox(Vector3d(0.107 * side, 0.93, -0.01), 1e-9));
    EXPECT_TRUE(joints.at(s + "elbow").isApprox(Vector3d(0.2 * side, 1.15, -0.012), 1e-9));
    EXPECT_TRUE(joints.at(s + "ankle").isApprox(Vector3d(0.1 * side, 0.09, 0.0), 1e-9));
    EXPECT_NEAR(joints.at(s + "toe").z(), -0.05 + 0.72 * 0.25, 1e-9);
  }
}

TEST(JointsFromPoints, TurnWithTheBody) {
  const Eigen::Affine3d turn = Eigen::Translation3d(1, 2, 3) * Eigen::AngleAxisd(2.0, Vector3d(1, 2, 3).normalized());
  Points turned = standing_person();
  for (auto& point : turned)
    if (point) point = turn * *point;
  const BodyJoints joints = joints_from_points(standing_person()), found = joints_from_points(turned);
  ASSERT_EQ(found.positions.size(), joints.positions.size());
  for (const auto& [name, position] : joints.positions)
    EXPECT_TRUE(found.at(name).isApprox(turn * position, 1e-9)) << name;
}

TEST(JointsFromPoints, UnseenLandmarksHaveNoJoint) {
  Points points = standing_person();
  points[landmark("left_wrist")].reset();
  points[landmark("right_knee")].reset();
  const BodyJoints joints = joints_from_points(points);
  EXPECT_FALSE(joints.has("left_wrist"));
  EXPECT_TRUE(joints.has("right_wrist"));
  EXPECT_FALSE(joints.has("right_knee"));
  EXPECT_FALSE(joints.has("right_ankle")) << "its direction needs the knee";
  points[landmark("left_hip")].reset();
  EXPECT_THROW(joints_from_points(points), Error);
}

}  // namespace
}  // namespace doppel::joints_from_points_test
