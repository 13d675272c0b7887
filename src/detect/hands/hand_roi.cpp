#include "doppel/detect/hands/hand_roi.h"

#include <algorithm>

namespace doppel {

namespace {

// Of the left arm. The landmarks of the right arm follow one later.
constexpr std::size_t kShoulder = 11, kElbow = 13, kWrist = 15, kPinky = 17, kIndex = 19;
// Chosen on the training frames of a rendered capture and on the first frames of a filmed one (docs/detect.md).
constexpr double kBeyondKnuckles = 0.2, kSidePerPalm = 3.2, kMinSidePerArm = 0.65;

Eigen::Vector2d arm_point(const BodyPose& body, std::size_t of_left, HandSide side) {
  const BodyLandmark& landmark = body.landmarks[side == HandSide::left ? of_left : of_left + 1];
  return {landmark.x, landmark.y};
}

double longest_of_arms(const BodyPose& body) {
  double longest = 0.0;
  for (const HandSide side : kHandSides) {
    const Eigen::Vector2d elbow = arm_point(body, kElbow, side);
    longest = std::max(
        {longest, (arm_point(body, kShoulder, side) - elbow).norm(), (arm_point(body, kWrist, side) - elbow).norm()});
  }
  return longest;
}

}  // namespace

BodyRoi hand_roi(const BodyPose& body, HandSide side) {
  const Eigen::Vector2d wrist = arm_point(body, kWrist, side),
                        knuckles = (2.0 * arm_point(body, kIndex, side) + arm_point(body, kPinky, side)) / 3.0,
                        palm = knuckles - wrist;
  return {knuckles + kBeyondKnuckles * palm,
          std::max(kSidePerPalm * palm.norm(), kMinSidePerArm * longest_of_arms(body)), upright_rotation(palm)};
}

}  // namespace doppel
