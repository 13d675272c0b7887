#pragma once

#include <string>
#include <vector>

#include "doppel/track/solver/least_squares.h"

namespace doppel {

enum class FrameState {
  tracked,      ///< followed from the frame before
  initialised,  ///< the first of a segment
  recovered,    ///< started anew, and found
  lost,         ///< not to be trusted: the pose is only a guess
};
std::string to_string(FrameState state);

/// The pose of a frame, and how far it is to be trusted.
struct TrackedFrame {
  std::vector<double> dofs;  ///< [D]
  FrameState state = FrameState::lost;
  int keypoints = 0;                                ///< that the detectors were confident of
  double agreeing = 0.0;                            ///< share of them that agree with the pose
  double keypoint_error = 0.0;                      ///< mean distance of those that agree, reference pixels
  int iterations = 0;                               ///< Gauss-Newton steps of all fits of this frame
  std::vector<TermCost> terms;                      ///< at the end
  SolverStop reason = SolverStop::iteration_limit;  ///< of the last fit

  bool trusted() const { return state != FrameState::lost; }
};

}  // namespace doppel
