#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>

#include "doppel/detect/keypoints/landmark_key.h"
#include "doppel/detect/keypoints/read_space_points.h"

namespace doppel::support {

/// How far points in space are from those of another program.
struct ReferenceDistance {
  double mean = 0.0;  ///< metres, over frames and common points
  std::size_t common = 0;
};

/// Compares with a result of Pose2Sim for the shared capture p2s. Its world has z up: (x, y, z) = trc (z, x, y), which
/// is (x, z, -y) in Doppel's.
inline ReferenceDistance distance_from_pose2sim(const SpacePoints& found, const SpacePoints& reference) {
  ReferenceDistance distance;
  long count = 0;
  for (std::size_t k = 0; k < reference.names.size(); ++k) {
    const auto index = find_landmark(found.names, reference.names[k] == "Head" ? "head_top" : reference.names[k]);
    if (!index) continue;
    ++distance.common;
    for (const auto& [frame, points] : reference.frames) {
      const auto& point = found.frames.at(frame)[*index];
      if (!point || !points[k]) continue;
      distance.mean += (*point - Eigen::Vector3d(points[k]->z(), points[k]->y(), -points[k]->x())).norm();
      ++count;
    }
  }
  distance.mean /= static_cast<double>(count);
  return distance;
}

}  // namespace doppel::support
