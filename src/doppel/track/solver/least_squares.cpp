#include "doppel/track/solver/least_squares.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace doppel {
namespace {

constexpr double kLessDamping = 0.2, kMoreDamping = 10.0, kSmallestDamping = 1e-9;

/// Raises the damping until a step gains.
/// @return whether one did; then `state`, `cost` and `length` are those after it
bool descend(LeastSquaresProblem& problem, Eigen::VectorXd& state, double& cost, double& length, double& damping,
             double largest_damping) {
  Eigen::VectorXd step;
  for (; damping <= largest_damping; damping *= kMoreDamping) {
    if (!problem.solve(damping, step) || !step.allFinite()) continue;
    Eigen::VectorXd candidate = problem.moved(state, step);
    const double found = problem.cost(candidate);
    if (!(found < cost)) continue;
    state = std::move(candidate);
    cost = found;
    length = step.size() > 0 ? step.cwiseAbs().maxCoeff() : 0.0;
    damping = std::max(kSmallestDamping, damping * kLessDamping);
    return true;
  }
  return false;
}

}  // namespace

std::string to_string(SolverStop reason) {
  switch (reason) {
    case SolverStop::small_gain:
      return "small gain";
    case SolverStop::small_step:
      return "small step";
    case SolverStop::no_descent:
      return "no descent";
    case SolverStop::iteration_limit:
      return "iteration limit";
    case SolverStop::not_finite:
      return "not finite";
  }
  return "unknown";
}

SolverSummary minimise(LeastSquaresProblem& problem, Eigen::VectorXd& state, const SolverOptions& options) {
  SolverSummary summary;
  double damping = options.initial_damping;
  std::optional<double> reached;  // the cost of the state, where it was the last one asked for
  while (summary.iterations < options.iterations) {
    double cost = problem.linearise(state);
    reached.reset();
    if (summary.iterations == 0) summary.initial_cost = cost;
    if (!std::isfinite(cost)) {
      summary.reason = SolverStop::not_finite;
      break;
    }
    const double before = cost;
    double length = 0.0;
    if (!descend(problem, state, cost, length, damping, options.largest_damping)) {
      summary.reason = SolverStop::no_descent;
      break;
    }
    ++summary.iterations;
    reached = cost;
    if (length < options.smallest_step) {
      summary.reason = SolverStop::small_step;
      break;
    }
    if (before - cost <= options.smallest_gain * before) {
      summary.reason = SolverStop::small_gain;
      break;
    }
  }
  summary.final_cost = reached ? *reached : problem.cost(state);
  summary.terms = problem.term_costs();
  if (options.iterations <= 0) summary.initial_cost = summary.final_cost;
  return summary;
}

}  // namespace doppel
