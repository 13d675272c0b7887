#include "doppel/track/energy/triangulation.h"

namespace doppel {

std::optional<TriangulatedPoint> triangulate(const std::vector<PinholeCamera>& cameras, const FrameEvidence& frame,
                                             int landmark, const TriangulationOptions& options) {
  std::vector<Sight> sights;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const Keypoint& seen = frame[c].keypoints[landmark];
    if (!(seen.confidence >= kSeenConfidence)) continue;
    std::optional<Sight> sight = sight_of(cameras[c], {seen.x, seen.y}, seen.confidence);
    if (!sight) continue;
    sight->unit_from_plane *= reference_pixels(cameras[c]);
    sights.push_back(*sight);
  }
  return triangulate(sights, options);
}

std::vector<std::optional<TriangulatedPoint>> triangulate_all(const std::vector<PinholeCamera>& cameras,
                                                              const FrameEvidence& frame, int num_landmarks) {
  std::vector<std::optional<TriangulatedPoint>> points;
  points.reserve(num_landmarks);
  for (int m = 0; m < num_landmarks; ++m) points.push_back(triangulate(cameras, frame, m));
  return points;
}

}  // namespace doppel
