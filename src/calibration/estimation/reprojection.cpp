#include "doppel/calibration/estimation/reprojection.h"

#include <cmath>
#include <limits>

namespace doppel {

std::vector<SeenFrom> seen_at(const PointTracks& tracks, double seconds, int point) {
  std::vector<SeenFrom> found;
  for (int c = 0; c < tracks.num_cameras(); ++c) {
    const CameraTrack& track = tracks.cameras[c];
    const TrackPoint seen = track.sample(track.frame_at(seconds), point);
    if (seen.seen()) found.push_back({c, seen});
  }
  return found;
}

std::optional<TriangulatedPoint> triangulate(const std::vector<Camera>& cameras, const std::vector<SeenFrom>& seen,
                                             const TriangulationOptions& options) {
  std::vector<Sight> sights;
  std::vector<std::size_t> of_sight;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const Camera& camera = cameras[seen[i].camera];
    std::optional<Sight> sight = sight_of(camera, seen[i].seen.pixel, seen[i].seen.confidence);
    if (!sight) continue;
    sight->unit_from_plane *= rig_reference_pixels(camera);
    sights.push_back(*sight);
    of_sight.push_back(i);
  }
  std::optional<TriangulatedPoint> point = triangulate(sights, options);
  if (!point) return point;
  std::vector<double> residuals(seen.size(), std::numeric_limits<double>::infinity());
  for (std::size_t i = 0; i < sights.size(); ++i) residuals[of_sight[i]] = point->residuals[i];
  point->residuals = std::move(residuals);
  return point;
}

std::vector<std::vector<double>> reprojection_distances(const std::vector<Camera>& cameras, const PointTracks& tracks,
                                                        const std::vector<double>& times) {
  std::vector<std::vector<double>> distances(cameras.size());
  for (const double time : times)
    for (int k = 0; k < tracks.num_points(); ++k) {
      const std::vector<SeenFrom> seen = seen_at(tracks, time, k);
      const auto point = triangulate(cameras, seen, {});
      if (!point) continue;
      for (std::size_t i = 0; i < seen.size(); ++i) {
        if (!std::isfinite(point->residuals[i])) continue;
        const Camera& camera = cameras[seen[i].camera];
        distances[seen[i].camera].push_back(point->residuals[i] / rig_reference_pixels(camera));
      }
    }
  return distances;
}

}  // namespace doppel
