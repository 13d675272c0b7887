#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <vector>

#include "doppel/calibration/estimation/align_cameras.h"
#include "doppel/geometry/camera.h"

namespace doppel::support {

/// Largest differences of rigs after the similarity that aligns their centres.
struct RigError {
  double degrees = 0.0, metres = 0.0;
};

/// The cameras moved such that their centres lie closest to those of others (Umeyama's similarity).
inline std::vector<Camera> aligned(std::vector<Camera> cameras, const std::vector<Camera>& to) {
  Eigen::Matrix3Xd from_centres(3, cameras.size()), to_centres(3, cameras.size());
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    from_centres.col(static_cast<Eigen::Index>(c)) = cameras[c].centre();
    to_centres.col(static_cast<Eigen::Index>(c)) = to[c].centre();
  }
  const Eigen::Matrix4d found = Eigen::umeyama(from_centres, to_centres, true);
  Similarity world;
  world.scale = found.col(0).head<3>().norm();
  world.rotation = found.topLeftCorner<3, 3>() / world.scale;
  world.shift = found.topRightCorner<3, 1>();
  for (Camera& camera : cameras) camera = transformed(camera, world);
  return cameras;
}

/// The largest error of a camera after alignment.
inline RigError error_of(const std::vector<Camera>& cameras, const std::vector<Camera>& ground_truth) {
  RigError error;
  const std::vector<Camera> moved = aligned(cameras, ground_truth);
  for (std::size_t c = 0; c < ground_truth.size(); ++c) {
    const double angle = Eigen::AngleAxisd(moved[c].R * ground_truth[c].R.transpose()).angle();
    error.degrees = std::max(error.degrees, angle * 180.0 / M_PI);
    error.metres = std::max(error.metres, (moved[c].centre() - ground_truth[c].centre()).norm());
  }
  return error;
}

}  // namespace doppel::support
