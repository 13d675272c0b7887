#include "doppel/detect/face/face_pose.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "doppel/core/as_size.h"
#include "doppel/detect/blazepose/body_pose.h"
#include "doppel/detect/face/face_landmarks.h"
#include "doppel/detect/hands/hand_pose.h"
#include "doppel/detect/keypoints/keypoint_map.h"
#include "doppel/detect/keypoints/landmark_key.h"

namespace doppel::face_pose_test {
namespace {

using Eigen::Vector3d;

/// Outputs in which only one point is not zero.
FacePose decode_point(std::size_t index, const Eigen::Vector3f& point, float presence, const BodyRoi& roi) {
  std::vector<float> points(3 * as_size(kNumFacePoints), 0.0f);
  for (std::size_t axis = 0; axis < 3; ++axis) points[3 * index + axis] = point[static_cast<int>(axis)];
  return decode_face({points, presence}, roi);
}

TEST(DecodeFace, ReadsPointsAndTheProbability) {
  const FacePose face = decode_point(467, {48, 144, -19.2f}, std::log(3.0f), {{300, 400}, 384, 0});
  EXPECT_LT((face.points[467] - Vector3d(300 - 96, 400 + 96, -38.4)).norm(), 1e-4);
  EXPECT_LT((face.points[0] - Vector3d(300 - 192, 400 - 192, 0)).norm(), 1e-9);
  EXPECT_NEAR(face.score, 0.75, 1e-6);
  EXPECT_EQ(face.roi.side, 384);
}

TEST(DecodeFace, TurnsPointsWithTheRegion) {
  const FacePose face = decode_point(10, {192, 96, 0}, 0, {{10, 20}, 100, 0.5 * std::numbers::pi});
  EXPECT_LT((face.points[10] - Vector3d(10, 70, 0)).norm(), 1e-6) << "the right side of the region is below its centre";
}

TEST(FacePoints, AreThoseOfTheLayoutBetweenBodyAndHands) {
  std::vector<std::string> names(kBodyLandmarkNames.begin(), kBodyLandmarkNames.end());
  for (int i = 0; i < kNumFacePoints; ++i) names.push_back(face_point_name(i));
  for (const std::string side : {"left_", "right_"})
    for (const char* name : kHandPointNames) names.push_back(side + name);
  EXPECT_EQ(read_keypoint_map("mediapipe543").layout.points, names);
  EXPECT_EQ(names.size(), 543u);
}

TEST(FacePoints, AreNotThoseOfOtherLayouts) {
  EXPECT_TRUE(is_face_point("face_mesh_17"));
  EXPECT_FALSE(is_face_point("face-17"));
  EXPECT_FALSE(is_face_point("nose"));
  for (const std::string& name : builtin_keypoint_maps()) {
    const KeypointMap map = read_keypoint_map(name);
    for (const FaceLandmark& landmark : kFaceLandmarks)
      EXPECT_EQ(map.find(face_point_name(landmark.point)) != nullptr, name == "mediapipe543") << name;
  }
}

/// Whoever mistypes a number of the table breaks the symmetry.
TEST(FaceLandmarks, AreSymmetric) {
  int in_the_middle = 0;
  for (const FaceLandmark& landmark : kFaceLandmarks) {
    const auto [x, y, z] = landmark.position;
    const auto is_mirrored = [&](const FaceLandmark& other) {
      return other.position == std::array<double, 3>{0.0 - x, y, z};
    };
    EXPECT_EQ(std::ranges::count_if(kFaceLandmarks, is_mirrored), 1) << landmark.point;
    in_the_middle += x == 0.0;
  }
  EXPECT_EQ(in_the_middle, 6);
}

}  // namespace
}  // namespace doppel::face_pose_test
