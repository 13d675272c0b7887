#include "doppel/detect/hands/hand_search.h"

#include <algorithm>
#include <array>

#include "doppel/core/as_size.h"
#include "doppel/detect/hands/hand_roi.h"

namespace doppel {

namespace {

constexpr std::array<std::size_t, 2> kWrists = {15, 16};  ///< left and right, of the body
/// A hand that is of the other side with a higher probability belongs to the other arm, or is misread.
constexpr double kClearlyOther = 0.9;
/// Of the side of the region: the mean distance between the points of two readings of one hand is smaller.
constexpr double kSameHand = 0.1;

std::optional<HandPose> find_hand(const HandReader& read, const cv::Mat& image, const BodyPose& body, HandSide side) {
  const std::optional<HandPose> hand = read(image, hand_roi(body, side));
  if (!hand) return hand;
  const double other = side == HandSide::left ? hand->right : 1.0 - hand->right;
  return other > kClearlyOther ? std::nullopt : hand;
}

bool coincide(const HandPose& a, const HandPose& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < as_size(kNumHandPoints); ++i) sum += (a.points[i] - b.points[i]).head<2>().norm();
  return sum / kNumHandPoints < kSameHand * std::min(a.roi.side, b.roi.side);
}

double distance_from_wrist(const HandPose& hand, const BodyPose& body, HandSide side) {
  const BodyLandmark& wrist = body.landmarks[kWrists[as_size(side)]];
  return (hand.points[0].head<2>() - Eigen::Vector2d(wrist.x, wrist.y)).norm();
}

}  // namespace

HandPair find_hands(const HandReader& read, const cv::Mat& image, const BodyPose& body) {
  HandPair hands;
  for (const HandSide side : kHandSides) hands[as_size(side)] = find_hand(read, image, body, side);
  auto& [left, right] = hands;
  if (left && right && coincide(*left, *right)) {
    const bool is_left =
        distance_from_wrist(*left, body, HandSide::left) <= distance_from_wrist(*right, body, HandSide::right);
    (is_left ? right : left).reset();
  }
  return hands;
}

double hand_confidence(const HandPose& hand, const BodyPose& body, HandSide side) {
  return hand.score * body.landmarks[kWrists[as_size(side)]].visibility;
}

}  // namespace doppel
