#include "doppel/track/energy/inliers.h"

namespace doppel {

Inliers count_inliers(const PoseModel& model, const PosedBody& body, const std::vector<PinholeCamera>& cameras,
                      const FrameEvidence& frame, double threshold) {
  Inliers result;
  double seen_weight = 0.0, agreeing_weight = 0.0, sum = 0.0;
  for (std::size_t c = 0; c < cameras.size(); ++c)
    for (int m = 0; m < model.num_landmarks(); ++m) {
      const Keypoint& seen = frame[c].keypoints[m];
      if (!(seen.confidence >= kSeenConfidence)) continue;
      const double weight = model.landmark_weight(m);
      ++result.keypoints;
      seen_weight += weight;
      const auto projected = project_with_jacobian(cameras[c], model.landmark(body, m));
      if (!projected) continue;
      const double distance =
          reference_pixels(cameras[c]) * (projected->pixel - Eigen::Vector2d(seen.x, seen.y)).norm();
      if (distance > threshold) continue;
      agreeing_weight += weight;
      sum += weight * distance;
    }
  result.ratio = seen_weight > 0.0 ? agreeing_weight / seen_weight : 0.0;
  result.error = agreeing_weight > 0.0 ? sum / agreeing_weight : 0.0;
  return result;
}

}  // namespace doppel
