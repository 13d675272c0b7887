#include "doppel/track/energy/inliers.h"

namespace doppel {

Inliers count_inliers(const PoseModel& model, const PosedBody& body, const std::vector<PinholeCamera>& cameras,
                      const FrameEvidence& frame, double threshold) {
  Inliers result;
  int agreeing = 0;
  double sum = 0.0;
  for (std::size_t c = 0; c < cameras.size(); ++c)
    for (int m = 0; m < model.num_landmarks(); ++m) {
      const Keypoint& seen = frame[c].keypoints[m];
      if (!(seen.confidence >= kSeenConfidence)) continue;
      ++result.keypoints;
      const auto projected = project_with_jacobian(cameras[c], model.landmark(body, m));
      if (!projected) continue;
      const double distance =
          reference_pixels(cameras[c]) * (projected->pixel - Eigen::Vector2d(seen.x, seen.y)).norm();
      if (distance > threshold) continue;
      ++agreeing;
      sum += distance;
    }
  result.ratio = result.keypoints > 0 ? static_cast<double>(agreeing) / result.keypoints : 0.0;
  result.error = agreeing > 0 ? sum / agreeing : 0.0;
  return result;
}

}  // namespace doppel
