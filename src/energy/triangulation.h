#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "doppel/energy/evidence.h"

namespace doppel {

/// A landmark seen by several cameras, placed in the world.
struct TriangulatedPoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  int views = 0;       ///< that agree with it
  double error = 0.0;  ///< root mean square distance in these, reference pixels
};

struct TriangulationOptions {
  double inlier_threshold = 25.0;  ///< reference pixels up to which a view is an inlier
  double smallest_angle = 0.03;  ///< radians between the rays of a pair that may place a point
};

/// Places landmark `landmark` where most cameras agree that it is: every pair of rays proposes a point, the one that
/// most views agree with wins (of those with equally many, the one with the smaller error) and is placed anew from all
/// of them by confidence. Gross outliers and left-right swaps in a minority of views do no harm.
/// @return nothing when no two views agree
std::optional<TriangulatedPoint> triangulate(const std::vector<Camera>& cameras, const FrameEvidence& frame,
                                             int landmark, const TriangulationOptions& options = {});

/// All landmarks of a frame, [M].
std::vector<std::optional<TriangulatedPoint>> triangulate_all(const std::vector<Camera>& cameras,
                                                              const FrameEvidence& frame, int num_landmarks,
                                                              const TriangulationOptions& options = {});

}  // namespace doppel
