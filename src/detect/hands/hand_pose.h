#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>
#include <string>

#include "doppel/detect/blazepose/roi.h"

namespace doppel {

/// Which hand of the person.
enum class HandSide { left, right };
inline constexpr std::array<HandSide, 2> kHandSides = {HandSide::left, HandSide::right};

inline constexpr int kNumHandPoints = 21;
/// The points in the network's order, without the side: "hand_root" (the wrist), "thumb1" to "thumb4" (the tip), and
/// the same for "forefinger", "middle_finger", "ring_finger" and "pinky_finger", whose point 1 is the knuckle.
extern const std::array<const char*, kNumHandPoints> kHandPointNames;
/// Whether a landmark is such a point of the left or right hand: "left_thumb1".
bool is_hand_point(const std::string& landmark);

/// One hand in one image.
struct HandPose {
  /// x and y: pixels of the image, first pixel centre at (0.5, 0.5), may lie outside of the image. z: depth relative to
  /// the wrist, in pixels too; negative: nearer to the camera.
  std::array<Eigen::Vector3d, kNumHandPoints> points;
  /// Metres, camera axes (x right, y down, z forward), origin near the middle of the hand.
  std::array<Eigen::Vector3d, kNumHandPoints> world;
  double score = 0.0;  ///< probability that the region shows a hand
  double right = 0.0;  ///< probability that it is a right hand
  BodyRoi roi;         ///< the region that the network saw
};

/// Both hands of a person, left and right; nothing for a hand that is not found.
using HandPair = std::array<std::optional<HandPose>, 2>;

inline constexpr int kHandPixels = 224;  ///< side of the network's input

/// What the network of hands computes.
struct HandOutputs {
  std::span<const float> points;  ///< [21, 3] pixels of the input
  std::span<const float> world;   ///< [21, 3] metres, x and y in the axes of the region
  float presence = 0.0f;          ///< probability of a hand
  float handedness = 0.0f;        ///< probability that the hand, as it looks in the input, is a right one
};

/// The hand, also of a mirrored region: in a mirror a left hand looks like a right one.
HandPose decode_hand(const HandOutputs& outputs, const BodyRoi& roi);

}  // namespace doppel
