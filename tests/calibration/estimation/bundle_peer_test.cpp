// Bundle adjustment against Ceres on the same problem.
#include <gmock/gmock.h>

#include "calibration/estimation/walking_bundle.h"
#ifdef DOPPEL_HAVE_CERES
#include "calibration/estimation/ceres_bundle.h"
#endif

namespace doppel {
namespace {

#ifndef DOPPEL_HAVE_CERES

TEST(BundlePeer, IsMissing) { GTEST_SKIP() << "Ceres (Debian: libceres-dev) is not installed: nothing was compared"; }

#else

/// Both solvers start at the same cost and end at the same cost and the same cameras.
void expect_same_minimum(const Bundle& bundle, const BundleOptions& options) {
  BundleProblem problem(bundle, options);
  Eigen::VectorXd state = problem.initial_state();
  SolverOptions solver;
  solver.iterations = 300;
  solver.function_tolerance = 1e-13;
  const SolverSummary ours = minimise(problem, state, solver);
  const support::CeresBundle theirs = support::solve_with_ceres(bundle, options, 300);
  EXPECT_NEAR(theirs.start_cost / ours.initial_cost, 1.0, 1e-12);
  EXPECT_LT(ours.final_cost, 0.5 * ours.initial_cost);
  EXPECT_NEAR(theirs.cost / ours.final_cost, 1.0, 1e-8);
  const Bundle found = problem.bundle(state);
  for (std::size_t c = 0; c < found.cameras.size(); ++c) {
    const Camera &a = found.cameras[c], &b = theirs.bundle.cameras[c];
    EXPECT_LT((a.centre() - b.centre()).norm(), 1e-5) << c;
    EXPECT_LT((a.R - b.R).norm(), 1e-5) << c;
    EXPECT_NEAR(a.K(0, 0) / b.K(0, 0), 1.0, 1e-5) << c;
  }
  for (std::size_t l = 0; l < found.lengths.size(); ++l)
    EXPECT_NEAR(found.lengths[l], theirs.bundle.lengths[l], 1e-5) << l;
}

/// Two cameras are fixed, so that no freedom of the world is left.
BundleOptions two_fixed_cameras() {
  BundleOptions options;
  options.fixed = {true, false, false, true, false};
  options.kernel = 8.0;
  return options;
}

TEST(BundlePeer, Poses) { expect_same_minimum(support::walking_bundle(5, 60), two_fixed_cameras()); }

TEST(BundlePeer, FocalLengths) {
  BundleOptions options = two_fixed_cameras();
  options.focal = true;
  Bundle bundle = support::walking_bundle(5, 60);
  bundle.cameras[1].K.topLeftCorner<2, 2>() *= 1.02;
  expect_same_minimum(bundle, options);
}

TEST(BundlePeer, Limbs) {
  expect_same_minimum(support::walking_bundle(5, 40, {{3, 4}, {4, 5}, {9, 10}, {10, 11}}), two_fixed_cameras());
}

#endif

}  // namespace
}  // namespace doppel
