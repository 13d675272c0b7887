#pragma once

#include <vector>

#include "doppel/track/evidence.h"
#include "doppel/track/pose_model.h"

namespace doppel {

/// How many keypoints agree with a pose.
struct Agreement {
  int keypoints = 0;   ///< that detectors were confident of
  double share = 0.0;  ///< of them that lie near their landmark
  double error = 0.0;  ///< mean distance of those, reference pixels
};
/// @param cameras without distortion, @param frame [C] what they saw @param near reference pixels
Agreement agreement_of(const PoseModel& model, const PosedBody& body, const std::vector<Camera>& cameras,
                       const FrameEvidence& frame, double near);

}  // namespace doppel
