#include "doppel/detect/hands/hand_search.h"

#include <gtest/gtest.h>

#include <vector>

#include "doppel/core/as_size.h"
#include "doppel/detect/hands/hand_roi.h"

namespace doppel::hand_search_test {
namespace {

using Eigen::Vector3d;

constexpr std::size_t kLeft = 0, kRight = 1;

/// A body whose palms are 30 pixels long and point down. Only arms are set.
BodyPose body_with_wrists(const Eigen::Vector2d& left, const Eigen::Vector2d& right) {
  BodyPose body{};
  const auto put = [&](std::size_t landmark, const Eigen::Vector2d& pixel) {
    body.landmarks[landmark].x = pixel.x();
    body.landmarks[landmark].y = pixel.y();
    body.landmarks[landmark].visibility = 0.5;
  };
  for (const std::size_t side : {kLeft, kRight}) {
    const Eigen::Vector2d& wrist = side == kLeft ? left : right;
    put(11 + side, wrist - Eigen::Vector2d(0, 100));
    put(13 + side, wrist - Eigen::Vector2d(0, 50));
    put(15 + side, wrist);
    for (const std::size_t knuckle : {17, 19}) put(knuckle + side, wrist + Eigen::Vector2d(0, 30));
  }
  return body;
}

/// A hand with all points at one pixel.
HandPose hand_at(const Eigen::Vector2d& pixel, const BodyRoi& roi, double right) {
  HandPose hand;
  hand.points.fill(Vector3d(pixel.x(), pixel.y(), 0));
  hand.score = 0.8;
  hand.right = right;
  hand.roi = roi;
  return hand;
}

const cv::Mat kImage(4, 4, CV_8UC3, cv::Scalar::all(0));

TEST(FindHands, ReadsTheRegionsOfBothHands) {
  const BodyPose body = body_with_wrists({200, 100}, {50, 100});
  std::vector<BodyRoi> seen;
  const HandPair hands = find_hands(
      [&](const cv::Mat& image, const BodyRoi& roi) {
        EXPECT_EQ(image.data, kImage.data);
        seen.push_back(roi);
        return std::optional(hand_at(roi.centre, roi, seen.size() == 1 ? 0.2 : 0.8));
      },
      kImage, body);
  ASSERT_EQ(seen.size(), 2u);
  for (const HandSide side : kHandSides) {
    const BodyRoi expected = hand_roi(body, side);
    EXPECT_EQ(seen[as_size(side)].centre, expected.centre);
    ASSERT_TRUE(hands[as_size(side)]);
    EXPECT_EQ(hands[as_size(side)]->roi.side, expected.side);
  }
}

TEST(FindHands, DropsAHandThatIsClearlyOfTheOtherSide) {
  const BodyPose body = body_with_wrists({200, 100}, {50, 100});
  const auto found = [&](double right) {
    return find_hands([&](const cv::Mat&, const BodyRoi& roi) { return hand_at(roi.centre, roi, right); }, kImage,
                      body);
  };
  EXPECT_FALSE(found(0.95)[kLeft]);
  EXPECT_TRUE(found(0.95)[kRight]);
  EXPECT_TRUE(found(0.85)[kLeft]) << "unsure";
  EXPECT_FALSE(found(0.05)[kRight]);
}

TEST(FindHands, GivesAHandThatBothSidesFindToTheNearerWrist) {
  for (const double x : {98.0, 103.0}) {
    const HandPair hands = find_hands(
        [&](const cv::Mat&, const BodyRoi& roi) {
          return hand_at({x, 100}, roi, 0.5);
        },
        kImage, body_with_wrists({95, 100}, {105, 100}));
    EXPECT_EQ(hands[kLeft].has_value(), x == 98.0);
    EXPECT_EQ(hands[kRight].has_value(), x == 103.0);
  }
}

TEST(FindHands, LeavesOutWhatIsNotFound) {
  const HandPair hands = find_hands([](const cv::Mat&, const BodyRoi&) { return std::optional<HandPose>(); }, kImage,
                                    body_with_wrists({200, 100}, {50, 100}));
  EXPECT_FALSE(hands[kLeft] || hands[kRight]);
}

TEST(HandConfidence, IsTheProbabilityTimesTheVisibilityOfTheWrist) {
  BodyPose body = body_with_wrists({200, 100}, {50, 100});
  body.landmarks[16].visibility = 0.25;
  const HandPose hand = hand_at({0, 0}, {}, 0.5);
  EXPECT_DOUBLE_EQ(hand_confidence(hand, body, HandSide::left), 0.8 * 0.5);
  EXPECT_DOUBLE_EQ(hand_confidence(hand, body, HandSide::right), 0.8 * 0.25);
}

}  // namespace
}  // namespace doppel::hand_search_test
