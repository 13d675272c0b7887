#include "doppel/track/energy/landmark_weight.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "doppel/detect/face/face_pose.h"
#include "doppel/detect/hands/hand_pose.h"

namespace doppel {
namespace {

/// The points of a hand that the networks of the body find (layout mediapipe33), without the side.
constexpr std::array<std::string_view, 3> kBodyPointsOfHands = {"thumb", "index", "pinky"};

/// The first point of the hand that a body network's landmark belongs to ("left_hand_root" for "left_index"); empty for
/// another landmark.
std::string hand_of(const std::string& landmark) {
  for (const std::string side : {"left_", "right_"})
    if (landmark.starts_with(side) &&
        std::ranges::find(kBodyPointsOfHands, landmark.substr(side.size())) != kBodyPointsOfHands.end())
      return side + kHandPointNames.front();
  return {};
}

/// What the points of one hand, or those of the face, count together.
constexpr double kWeightOfHand = 3.0, kWeightOfFace = 3.0;

}  // namespace

std::vector<double> landmark_fit_weights(const std::vector<std::string>& landmarks) {
  const auto face_points = static_cast<double>(std::ranges::count_if(landmarks, is_face_point));
  std::vector<double> weights;
  for (const std::string& name : landmarks) {
    const std::string hand = hand_of(name);
    const bool is_doubled = !hand.empty() && std::ranges::find(landmarks, hand) != landmarks.end();
    weights.push_back(is_doubled            ? 0.0
                      : is_hand_point(name) ? kWeightOfHand / kNumHandPoints
                      : is_face_point(name) ? kWeightOfFace / face_points
                                            : 1.0);
  }
  return weights;
}

}  // namespace doppel
