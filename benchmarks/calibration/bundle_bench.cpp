/// Bundle adjustment of a rig over the points of a person who walks: our solve against Ceres (if installed) on the same
/// residuals and kernel, to the same cost. One thread. All cameras but two are 1 degree and 3 cm off.
///   bundle_bench [cameras] [frames]

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "calibration/estimation/walking_bundle.h"
#include "support/ratio.h"
#ifdef DOPPEL_HAVE_CERES
#include "calibration/estimation/ceres_bundle.h"
#endif

namespace doppel::bench {
namespace {

constexpr double kTolerance = 1e-6;  // of the cost, as in refine_rig

SolverSummary solve(const Bundle& bundle, const BundleOptions& options) {
  BundleProblem problem(bundle, options);
  Eigen::VectorXd state = problem.initial_state();
  SolverOptions solver;
  solver.iterations = 100;
  solver.function_tolerance = kTolerance;
  return minimise(problem, state, solver);
}

int run(int cameras, int frames) {
  const Bundle bundle = support::walking_bundle(cameras, frames);
  BundleOptions options;
  options.fixed.resize(bundle.cameras.size(), false);
  options.fixed[0] = options.fixed[3] = true;
  options.kernel = 8.0;
  const SolverSummary ours = solve(bundle, options);
  std::printf("%d cameras, %zu points, %zu observations, one thread\ncost: start %.8g, ours %.8g in %d steps\n",
              cameras, bundle.points.size(), bundle.observations.size(), ours.initial_cost, ours.final_cost,
              ours.iterations);
  std::vector<Candidate> candidates;
#ifdef DOPPEL_HAVE_CERES
  const double wanted = ours.final_cost * (1.0 + kTolerance);
  const support::CeresBundle theirs = support::solve_with_ceres(bundle, options, 100, wanted);
  std::printf("      Ceres: start %.8g, end %.8g in %d steps\n", theirs.start_cost, theirs.cost, theirs.steps);
  candidates.push_back({"Ceres, to our cost", [&] { support::solve_with_ceres(bundle, options, 100, wanted); }});
#endif
  candidates.push_back({"ours", [&] { solve(bundle, options); }});
  RatioOptions turns;
  turns.turns = 11;
  compare("bundle adjustment", candidates, turns);
  return std::isfinite(ours.final_cost) ? 0 : 1;
}

}  // namespace
}  // namespace doppel::bench

int main(int argc, char** argv) {
  const auto number = [&](int i, int otherwise) { return argc > i ? std::max(4, std::atoi(argv[i])) : otherwise; };
  return doppel::bench::run(number(1, 8), number(2, 100));
}
