#pragma once

#include <vector>

#include "doppel/track/energy/evidence.h"
#include "doppel/track/energy/pose_model.h"

namespace doppel {

/// The inliers of a pose: keypoints within the inlier threshold of their landmark. Ratio and error count keypoints by
/// the model's `landmark_weight`.
struct Inliers {
  int keypoints = 0;   ///< number of confident keypoints
  double ratio = 0.0;  ///< inliers among the confident keypoints
  double error = 0.0;  ///< mean distance of the inliers, reference pixels
};
/// @param cameras, frame [C] @param threshold reference pixels
Inliers count_inliers(const PoseModel& model, const PosedBody& body, const std::vector<PinholeCamera>& cameras,
                      const FrameEvidence& frame, double threshold);

}  // namespace doppel
