#pragma once

#include <vector>

#include "doppel/track/energy/terms/point_term.h"
#include "doppel/track/energy/terms/silhouette_term.h"
#include "doppel/track/livecap/livecap.h"

namespace doppel::bench {

/// All that the energy of one frame's pose is made of (4.1-4.6), in the units of the terms, so that both solvers
/// minimise the same sum. One camera; M landmarks, D DoFs.
struct PoseFrame {
  const PoseModel* model;
  std::vector<PinholeCamera> cameras;       ///< the one
  FrameEvidence evidence;                   ///< keypoints and the mask's outline
  std::vector<OutlineVertex> outline;       ///< of the surface at the start
  std::vector<PointTerm::Target> joints;    ///< in space
  std::vector<PointTerm::Target> previous;  ///< landmarks of the last frame
  std::vector<double> landmark_weights;     ///< [M]
  std::vector<double> start, expected;      ///< [D]
  LivecapOptions options;
};

struct PoseSolution {
  std::vector<double> dofs;
  int steps = 0;
};

/// Ceres with automatic derivatives of one functor that gives all rows.
/// @param wanted cost at which to stop, in our units
PoseSolution solve_with_ceres(const PoseFrame& frame, double wanted, int most_steps);
/// The cost of the start as the functor gives it, in our units.
double ceres_start_cost(const PoseFrame& frame);

}  // namespace doppel::bench
