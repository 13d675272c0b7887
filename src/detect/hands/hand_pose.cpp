#include "doppel/detect/hands/hand_pose.h"

#include <algorithm>

#include "doppel/core/as_size.h"

namespace doppel {

const std::array<const char*, kNumHandPoints> kHandPointNames = {
    "hand_root",      "thumb1",        "thumb2",       "thumb3",         "thumb4",         "forefinger1",
    "forefinger2",    "forefinger3",   "forefinger4",  "middle_finger1", "middle_finger2", "middle_finger3",
    "middle_finger4", "ring_finger1",  "ring_finger2", "ring_finger3",   "ring_finger4",   "pinky_finger1",
    "pinky_finger2",  "pinky_finger3", "pinky_finger4"};

bool is_hand_point(const std::string& landmark) {
  for (const std::string side : {"left_", "right_"})
    if (landmark.starts_with(side))
      return std::find(kHandPointNames.begin(), kHandPointNames.end(), landmark.substr(side.size())) !=
             kHandPointNames.end();
  return false;
}

HandPose decode_hand(const HandOutputs& outputs, const BodyRoi& roi) {
  HandPose hand;
  hand.score = outputs.presence;
  hand.right = roi.mirrored ? 1.0 - outputs.handedness : outputs.handedness;
  hand.roi = roi;
  const Eigen::Matrix2d axes = roi.axes();
  for (std::size_t i = 0; i < as_size(kNumHandPoints); ++i) {
    const float *point = &outputs.points[3 * i], *metres = &outputs.world[3 * i];
    const Eigen::Vector2d position = Eigen::Vector2d(point[0], point[1]) / kHandPixels;
    hand.points[i] << roi.image_from_roi(position), point[2] / kHandPixels * roi.side;
    hand.world[i] << axes * Eigen::Vector2d(metres[0], metres[1]), metres[2];
  }
  return hand;
}

}  // namespace doppel
