#pragma once

#include "doppel/calibration/estimation/bundle_problem.h"

namespace doppel::support {

/// What Ceres makes of a bundle.
struct CeresBundle {
  Bundle bundle;
  double start_cost = 0.0, cost = 0.0;  ///< as BundleProblem counts them
  int steps = 0;
};

/// Minimises the cost of `BundleProblem(bundle, options)` with Ceres: residuals of its own, automatic derivatives,
/// Schur complement over the points, one thread. Lenses: `opencv` with up to five coefficients.
/// @param options without principal points @param wanted Ceres stops at this cost
CeresBundle solve_with_ceres(const Bundle& bundle, const BundleOptions& options, int most_steps, double wanted = 0.0);

}  // namespace doppel::support
