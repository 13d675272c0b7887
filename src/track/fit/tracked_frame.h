#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "doppel/solver/least_squares.h"

namespace doppel {

enum class FrameState {
  tracked,      ///< found from the prediction of the last frames
  initialised,  ///< the first found frame of a segment
  recovered,    ///< found by a new start
  lost,         ///< too few inliers; the pose is a guess
};
std::string to_string(FrameState state);

/// The pose of a frame, and how well it fits.
struct TrackedFrame {
  std::vector<double> dofs;  ///< [D]
  FrameState state = FrameState::lost;
  int keypoints = 0;                                              ///< number of confident keypoints
  double inlier_ratio = 0.0;                                      ///< inliers among the confident keypoints
  double keypoint_error = 0.0;                                    ///< mean distance of the inliers, reference pixels
  int iterations = 0;                                             ///< Gauss-Newton steps of all fits of this frame
  std::vector<TermCost> terms;                                    ///< at the end
  ConvergenceReason reason = ConvergenceReason::iteration_limit;  ///< of the last fit

  bool found() const { return state != FrameState::lost; }
};

/// The result of a tracker for one frame. Methods leave fields empty that they do not compute.
struct FrameResult {
  TrackedFrame pose;
  Eigen::Matrix3Xd vertices;  ///< [3,N] world metres; in a lost frame those of the last found pose
  std::vector<double> graph;  ///< [K*6] A and T of each node in turn (5.9)
  double pose_seconds = 0.0, surface_seconds = 0.0;
};

}  // namespace doppel
