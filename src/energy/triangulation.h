#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "doppel/energy/evidence.h"

namespace doppel {

/// A triangulated landmark, world metres.
struct TriangulatedPoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  int views = 0;       ///< number of inlier views
  double error = 0.0;  ///< root mean square distance in the inlier views, reference pixels
};

struct TriangulationOptions {
  double inlier_threshold = 25.0;  ///< reference pixels up to which a view is an inlier
  double smallest_angle = 0.03;    ///< radians between two rays that may propose a point
};

/// Triangulates a landmark robustly. Every pair of rays proposes a point. The point with the most inlier views wins;
/// among equals, the one with the smaller error. It is then triangulated again from all inlier views, weighted by
/// confidence. Gross outliers and left-right swaps in a minority of views do no harm.
/// @return nothing when no point has two inlier views
std::optional<TriangulatedPoint> triangulate(const std::vector<PinholeCamera>& cameras, const FrameEvidence& frame,
                                             int landmark, const TriangulationOptions& options = {});

/// All landmarks of a frame, [M].
std::vector<std::optional<TriangulatedPoint>> triangulate_all(const std::vector<PinholeCamera>& cameras,
                                                              const FrameEvidence& frame, int num_landmarks,
                                                              const TriangulationOptions& options = {});

}  // namespace doppel
