#include "doppel/detect/hands/hand_pose.h"

#include <gtest/gtest.h>

#include <numbers>
#include <vector>

#include "doppel/core/as_size.h"
#include "doppel/detect/blazepose/body_pose.h"
#include "doppel/detect/keypoints/keypoint_map.h"

namespace doppel::hand_pose_test {
namespace {

using Eigen::Vector3d;

/// Outputs in which only one point is not zero.
HandPose decode_point(std::size_t index, const Eigen::Vector3f& point, const Eigen::Vector3f& metres,
                      const BodyRoi& roi, float handedness = 0.9f) {
  std::vector<float> points(3 * as_size(kNumHandPoints), 0.0f), world = points;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    points[3 * index + axis] = point[static_cast<int>(axis)];
    world[3 * index + axis] = metres[static_cast<int>(axis)];
  }
  return decode_hand({points, world, 0.75f, handedness}, roi);
}

TEST(DecodeHand, ReadsPointsAndProbabilities) {
  const HandPose hand = decode_point(3, {56, 168, -22.4f}, {0.01f, -0.02f, 0.03f}, {{300, 400}, 448, 0});
  EXPECT_LT((hand.points[3] - Vector3d(300 - 112, 400 + 112, -44.8)).norm(), 1e-4);
  EXPECT_LT((hand.world[3] - Vector3d(0.01, -0.02, 0.03)).norm(), 1e-8);
  EXPECT_FLOAT_EQ(static_cast<float>(hand.score), 0.75f);
  EXPECT_FLOAT_EQ(static_cast<float>(hand.right), 0.9f);
  EXPECT_EQ(hand.roi.side, 448);
}

TEST(DecodeHand, TurnsPointsAndJointsWithTheRegion) {
  const HandPose hand = decode_point(20, {224, 112, 0}, {1, 0, 0.5f}, {{10, 20}, 100, 0.5 * std::numbers::pi});
  EXPECT_LT((hand.points[20] - Vector3d(10, 70, 0)).norm(), 1e-6) << "the right side of the region is below its centre";
  EXPECT_LT((hand.world[20] - Vector3d(0, 1, 0.5)).norm(), 1e-9);
}

TEST(DecodeHand, AMirroredRegionShowsTheOtherHand) {
  BodyRoi roi{{112, 112}, 224, 0};
  roi.mirrored = true;
  const HandPose hand = decode_point(8, {56, 168, -3}, {0.3f, -0.4f, 0.1f}, roi);
  EXPECT_LT((hand.points[8] - Vector3d(224 - 56, 168, -3)).norm(), 1e-5);
  EXPECT_LT((hand.world[8] - Vector3d(-0.3, -0.4, 0.1)).norm(), 1e-7);
  EXPECT_NEAR(hand.right, 0.1, 1e-6);
}

TEST(HandPoints, AreThoseOfTheLayoutBehindTheBody) {
  std::vector<std::string> names(kBodyLandmarkNames.begin(), kBodyLandmarkNames.end());
  for (const std::string side : {"left_", "right_"})
    for (const char* name : kHandPointNames) names.push_back(side + name);
  EXPECT_EQ(read_keypoint_map("mediapipe75").layout.points, names);
  EXPECT_EQ(names.size(), 75u);
}

}  // namespace
}  // namespace doppel::hand_pose_test
