#include "doppel/detect/face/face_roi.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace doppel::face_roi_test {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr std::size_t kNose = 0, kLeftEye = 2, kRightEye = 5, kLeftEar = 7, kRightEar = 8, kMouthLeft = 9,
                      kMouthRight = 10;

/// Nose, eyes, ears and corners of the mouth of a head, metres: x to the person's left, y up, z forwards.
const std::vector<std::pair<std::size_t, Vector3d>> kHead{{kNose, {0, 0, 0.10}},
                                                          {kLeftEye, {0.03, 0.04, 0.08}},
                                                          {kRightEye, {-0.03, 0.04, 0.08}},
                                                          {kLeftEar, {0.075, 0.02, 0}},
                                                          {kRightEar, {-0.075, 0.02, 0}},
                                                          {kMouthLeft, {0.025, -0.03, 0.08}},
                                                          {kMouthRight, {-0.025, -0.03, 0.08}}};

/// A head that was turned from looking at the camera, seen without perspective, 1000 pixels a metre.
/// @param turn in the axes of the head, before it faces the camera
BodyPose head_seen(const Eigen::Matrix3d& turn) {
  BodyPose body{};
  for (const auto& [landmark, point] : kHead) {
    const Vector3d turned = turn * point, seen(turned.x(), -turned.y(), -turned.z());
    body.world[landmark] = seen;
    body.landmarks[landmark].x = 500 + 1000 * seen.x();
    body.landmarks[landmark].y = 400 + 1000 * seen.y();
  }
  return body;
}

Eigen::Matrix3d turned(double degrees, const Vector3d& axis) {
  return Eigen::AngleAxisd(degrees * std::numbers::pi / 180, axis).toRotationMatrix();
}

TEST(FaceRoi, OfAFaceThatLooksAtTheCamera) {
  const auto roi = face_roi(head_seen(Eigen::Matrix3d::Identity()));
  ASSERT_TRUE(roi);
  EXPECT_LT((roi->centre - Vector2d(500, 395)).norm(), 1e-9) << "the middle of eyes and mouth";
  EXPECT_NEAR(roi->side, 3.8 * 70, 1e-9);
  EXPECT_NEAR(roi->rotation, 0, 1e-9);
  EXPECT_FALSE(roi->mirrored);
}

TEST(FaceRoi, KeepsItsSizeWhenTheHeadTurnsOrNods) {
  const auto aside = face_roi(head_seen(turned(60, Vector3d::UnitY())));
  const auto nodding = face_roi(head_seen(turned(45, Vector3d::UnitX())));
  ASSERT_TRUE(aside && nodding);
  EXPECT_NEAR(aside->side, 3.8 * 70, 1e-9);
  EXPECT_NEAR(nodding->side, 4.2 * 60, 1e-9);
  EXPECT_NEAR(aside->rotation, 0, 1e-9);
  EXPECT_NEAR(nodding->rotation, 0, 1e-9);
}

TEST(FaceRoi, RollsWithTheHead) {
  for (const double degrees : {-120.0, 30.0, 100.0}) {
    const auto roi = face_roi(head_seen(turned(degrees, Vector3d::UnitZ())));
    ASSERT_TRUE(roi);
    // The camera sees the person's left on the right: a roll to the left is clockwise in the image.
    EXPECT_NEAR(roi->rotation, -degrees * std::numbers::pi / 180, 1e-9);
    EXPECT_NEAR(roi->side, 3.8 * 70, 1e-9);
  }
}

TEST(FaceRoi, IsNothingWhereTheFaceLooksAway) {
  // The line from the middle of the ears to the nose falls by 0.02 of 0.10 m.
  const double down = std::atan2(0.02, 0.10) * 180 / std::numbers::pi;
  for (const double sign : {-1.0, 1.0}) {
    EXPECT_TRUE(face_roi(head_seen(turned(sign * 68, Vector3d::UnitY()))));
    EXPECT_FALSE(face_roi(head_seen(turned(sign * 72, Vector3d::UnitY()))));
    EXPECT_FALSE(face_roi(head_seen(turned(sign * 180, Vector3d::UnitY()))));
    EXPECT_TRUE(face_roi(head_seen(turned(sign * 68 - down, Vector3d::UnitX()))));
    EXPECT_FALSE(face_roi(head_seen(turned(sign * 72 - down, Vector3d::UnitX()))));
  }
}

TEST(FaceRoi, OfABodyWithoutExtentIsNotValid) {
  BodyPose body{};
  body.world.fill(Vector3d(0, 0, 1));
  body.world[kNose].z() = 0.9;
  EXPECT_FALSE(face_roi(body).value().valid());
  body.world[kNose].z() = 1;
  EXPECT_FALSE(face_roi(body).has_value()) << "a nose between the ears looks nowhere";
}

/// A face whose points fill a box, turned by an angle around its centre.
FacePose box_of_points(const Vector2d& centre, double width, double height, double angle) {
  const Eigen::Matrix2d turn = Eigen::Rotation2Dd(angle).toRotationMatrix();
  FacePose face;
  for (std::size_t i = 0; i < face.points.size(); ++i) {
    const double x = static_cast<double>(i % 2) - 0.5, y = static_cast<double>(i / 2 % 2) - 0.5;
    face.points[i].head<2>() = centre + turn * Vector2d(width * x, height * y);
  }
  face.points[33].head<2>() = centre + turn * Vector2d(-0.3 * width, -0.1 * height);
  face.points[263].head<2>() = centre + turn * Vector2d(0.3 * width, -0.1 * height);
  return face;
}

TEST(RegionOfAFace, IsOneAndAHalfTimesTheLongerSideOfItsBox) {
  for (const double angle : {0.0, 0.6, -2.5}) {
    for (const double height : {90.0, 150.0}) {
      const BodyRoi roi = face_roi(box_of_points({70, 80}, 120, height, angle));
      EXPECT_LT((roi.centre - Vector2d(70, 80)).norm(), 1e-9);
      EXPECT_NEAR(roi.side, 1.5 * std::max(height, 120.0), 1e-9);
      EXPECT_NEAR(roi.rotation, angle, 1e-9);
    }
  }
}

}  // namespace
}  // namespace doppel::face_roi_test
