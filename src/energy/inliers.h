#pragma once

#include <vector>

#include "doppel/energy/evidence.h"
#include "doppel/energy/pose_model.h"

namespace doppel {

/// How many keypoints agree with a pose: those that lie within a distance of the landmark they detect.
struct Inliers {
  int keypoints = 0;   ///< confident detections
  double ratio = 0.0;  ///< share of them that are inliers
  double error = 0.0;  ///< mean distance of the inliers, reference pixels
};
/// @param cameras without distortion, @param frame [C] what they saw @param threshold reference pixels
Inliers count_inliers(const PoseModel& model, const PosedBody& body, const std::vector<Camera>& cameras,
                       const FrameEvidence& frame, double threshold);

}  // namespace doppel
