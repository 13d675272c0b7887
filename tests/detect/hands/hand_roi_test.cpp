#include "doppel/detect/hands/hand_roi.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace doppel::hand_roi_test {
namespace {

using Eigen::Vector2d;

constexpr std::size_t kLeft = 0, kRight = 1;

void put(BodyPose& body, std::size_t landmark, const Vector2d& pixel) {
  body.landmarks[landmark].x = pixel.x();
  body.landmarks[landmark].y = pixel.y();
}

/// Arms whose upper arm and forearm have the length `arm`, and a palm from wrist to knuckles. The middle of the
/// knuckles lies at a third of the way from index to pinky.
void put_arm(BodyPose& body, std::size_t side, const Vector2d& wrist, const Vector2d& palm, double arm) {
  const Vector2d across(-palm.y(), palm.x());
  put(body, 11 + side, wrist + Vector2d(0, -2 * arm));
  put(body, 13 + side, wrist + Vector2d(0, -arm));
  put(body, 15 + side, wrist);
  put(body, 17 + side, wrist + palm + 0.4 * across);
  put(body, 19 + side, wrist + palm - 0.2 * across);
}

TEST(HandRoi, FollowsThePalm) {
  BodyPose body{};
  put_arm(body, kLeft, {100, 200}, {0, 30}, 90);
  put_arm(body, kRight, {40, 210}, {-40, 0}, 90);
  const BodyRoi left = hand_roi(body, HandSide::left), right = hand_roi(body, HandSide::right);
  EXPECT_LT((left.centre - Vector2d(100, 236)).norm(), 1e-9);
  EXPECT_NEAR(left.side, 96, 1e-9);
  EXPECT_NEAR(std::abs(left.rotation), std::numbers::pi, 1e-9) << "fingers that point down are turned up";
  EXPECT_LT((right.centre - Vector2d(-8, 210)).norm(), 1e-9);
  EXPECT_NEAR(right.side, 128, 1e-9);
  EXPECT_LT((right.roi_from_image({-40, 210}) - Vector2d(0.5, 0.25)).norm(), 1e-9)
      << "the fingers are above the centre";
  EXPECT_FALSE(left.mirrored || right.mirrored);
}

TEST(HandRoi, HasAMinimumForHandsThatPointToTheCamera) {
  BodyPose body{};
  put_arm(body, kLeft, {100, 200}, {0, 6}, 40);
  put_arm(body, kRight, {40, 210}, {-40, 0}, 100);
  EXPECT_NEAR(hand_roi(body, HandSide::left).side, 65, 1e-9) << "of the longer arm";
}

TEST(HandRoi, OfABodyWithoutExtentIsNotValid) { EXPECT_FALSE(hand_roi(BodyPose{}, HandSide::left).valid()); }

TEST(HandRoi, TurnsWithTheImage) {
  BodyPose body{}, turned{};
  put_arm(body, kLeft, {100, 200}, {11, 30}, 60);
  put_arm(body, kRight, {40, 210}, {-20, 9}, 70);
  const double angle = 0.7;
  const Eigen::Matrix2d rotation = Eigen::Rotation2Dd(angle).toRotationMatrix();
  for (std::size_t i = 0; i < body.landmarks.size(); ++i)
    put(turned, i, rotation * Vector2d(body.landmarks[i].x, body.landmarks[i].y));
  for (const HandSide side : kHandSides) {
    const BodyRoi before = hand_roi(body, side), after = hand_roi(turned, side);
    EXPECT_LT((after.centre - rotation * before.centre).norm(), 1e-9);
    EXPECT_NEAR(after.side, before.side, 1e-9);
    EXPECT_NEAR(std::remainder(after.rotation - before.rotation - angle, 2 * std::numbers::pi), 0, 1e-9);
  }
}

}  // namespace
}  // namespace doppel::hand_roi_test
