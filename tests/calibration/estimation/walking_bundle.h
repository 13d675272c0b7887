#pragma once

#include <algorithm>
#include <array>
#include <iterator>
#include <vector>

#include "calibration/estimation/walking_rig.h"
#include "doppel/calibration/estimation/bundle_problem.h"
#include "doppel/calibration/estimation/reprojection.h"

namespace doppel::support {

/// A bundle of a person who walks, seen with noise and outliers by cameras with lens distortion; the cameras but the
/// first and the fourth are 1 degree and 3 cm off.
/// @param limbs pairs of points that are linked
inline Bundle walking_bundle(int cameras, long frames, const std::vector<std::array<int, 2>>& limbs = {}) {
  Bundle bundle;
  bundle.cameras = rig_of(cameras, 1000);
  for (Camera& camera : bundle.cameras) {
    const double lens[] = {-0.1, 0.03, 1e-3, -2e-3, 0.01};
    std::copy(std::begin(lens), std::end(lens), camera.distortion.begin());
  }
  FilmOptions film_options;
  film_options.frames = frames;
  const PointTracks tracks = film(bundle.cameras, walker, film_options);
  for (std::size_t c = 0; c < bundle.cameras.size(); ++c)
    if (c != 0 && c != 3)
      bundle.cameras[c] = disturbed({bundle.cameras[c]}, 1.0, 0.03, static_cast<unsigned>(c) + 1)[0];
  TriangulationOptions loose;
  loose.inlier_threshold = 60.0;
  int group = 0;
  for (const double time : tracks.times()) {
    std::vector<int> index(tracks.num_points(), -1);
    for (int k = 0; k < tracks.num_points(); ++k) {
      const std::vector<SeenFrom> seen = seen_at(tracks, time, k);
      const auto point = triangulate(bundle.cameras, seen, loose);
      if (!point) continue;
      index[k] = static_cast<int>(bundle.points.size());
      for (const SeenFrom& view : seen)
        bundle.observations.push_back({view.camera, index[k], view.seen.pixel, view.seen.confidence});
      bundle.points.push_back({point->position, group});
    }
    for (std::size_t l = 0; l < limbs.size(); ++l) {
      const int a = index[limbs[l][0]], b = index[limbs[l][1]];
      if (a >= 0 && b >= 0) bundle.links.push_back({{a, b}, static_cast<int>(l)});
    }
    ++group;
  }
  bundle.lengths.assign(limbs.size(), 0.3);
  return bundle;
}

}  // namespace doppel::support
