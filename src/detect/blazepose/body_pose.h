#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core.hpp>
#include <span>

#include "doppel/detect/blazepose/roi.h"

namespace doppel {

inline constexpr int kNumBodyLandmarks = 33;
/// MediaPipe's names of the landmarks, in its order ("mediapipe33"). Left is the person's left.
extern const std::array<const char*, kNumBodyLandmarks> kBodyLandmarkNames;

/// A landmark in the image.
struct BodyLandmark {
  double x = 0.0, y = 0.0;  ///< pixels of the image, first pixel centre at (0.5, 0.5); may lie outside of the image
  double z = 0.0;           ///< depth relative to the hips, in pixels too; negative: nearer to the camera
  double visibility = 0.0;  ///< probability that the landmark is in the image and nothing hides it
  double presence = 0.0;    ///< probability that the landmark is in the image
};

/// One person in one image.
struct BodyPose {
  std::array<BodyLandmark, kNumBodyLandmarks> landmarks;
  /// Metres, camera axes (x right, y down, z forward), origin near the middle of the hips.
  std::array<Eigen::Vector3d, kNumBodyLandmarks> world;
  double score = 0.0;  ///< probability that the region shows a person
  BodyRoi roi;         ///< the region that the landmark network saw
  BodyRoi next_roi;    ///< the region around these landmarks: where to look for the person in the next frame
  cv::Mat mask;        ///< 8-bit, size of the image: probability of the person times 255; empty if not asked for
};

/// How far to trust a landmark in the image: its visibility, and a tenth of it for the nose, the eyes and the mouth
/// where the head hides them. There, the network guesses them with full visibility. The head hides the face of a person
/// whose nose is farther from the camera than the ears.
double landmark_confidence(const BodyPose& pose, std::size_t landmark);

inline constexpr int kRoiPixels = 256;     ///< side of the landmark network's input and of its mask
inline constexpr int kHeatmapPixels = 64;  ///< side of its heat maps
inline constexpr int kNetworkPoints = 39;  ///< the landmarks, two points for `next_roi`, four unused points

/// What the landmark network computes.
struct LandmarkOutputs {
  std::span<const float> points;    ///< [39, 5] x, y, z in pixels of the input, visibility and presence as logits
  std::span<const float> heatmaps;  ///< [64, 64, 39] logits
  std::span<const float> world;     ///< [39, 3] metres, x and y in the axes of the region
  float presence = 0.0f;            ///< probability of a person
};

/// The pose without its mask, also of a mirrored region. x and y of a point move to the weighted mean of its heat map
/// in a window of 7 x 7 cells around it, if the map has a probability of 0.5 or more there.
BodyPose decode_pose(const LandmarkOutputs& outputs, const BodyRoi& roi);

/// The mean of the points of two poses of one person in one image. Score, regions and mask are those of the first.
BodyPose mean_pose(const BodyPose& first, const BodyPose& second);

/// The probability of the person in each pixel of the image, times 255, 8-bit; 0 outside of the region. The network's
/// mask is sampled bilinearly.
/// @param logits [256, 256]
cv::Mat draw_person_mask(std::span<const float> logits, const BodyRoi& roi, cv::Size image);

}  // namespace doppel
