#include "doppel/solver/least_squares.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace doppel {
namespace {

constexpr double kLessDamping = 0.2, kMoreDamping = 10.0, kMinDamping = 1e-9;

/// Raises the damping until a step lowers the cost.
/// @return whether such a step was found; `state`, `cost` and `length` are then those after the step
bool descend(LeastSquaresProblem& problem, Eigen::VectorXd& state, double& cost, double& length, double& damping,
             double max_damping) {
  Eigen::VectorXd step;
  for (; damping <= max_damping; damping *= kMoreDamping) {
    if (!problem.solve(damping, step) || !step.allFinite()) continue;
    Eigen::VectorXd candidate = problem.moved(state, step);
    const double found = problem.cost(candidate);
    if (!(found < cost)) continue;
    state = std::move(candidate);
    cost = found;
    length = step.size() > 0 ? step.cwiseAbs().maxCoeff() : 0.0;
    damping = std::max(kMinDamping, damping * kLessDamping);
    return true;
  }
  return false;
}

}  // namespace

std::string to_string(ConvergenceReason reason) {
  switch (reason) {
    case ConvergenceReason::function_tolerance:
      return "function tolerance";
    case ConvergenceReason::parameter_tolerance:
      return "parameter tolerance";
    case ConvergenceReason::no_descent:
      return "no descent";
    case ConvergenceReason::iteration_limit:
      return "iteration limit";
    case ConvergenceReason::not_finite:
      return "not finite";
  }
  return "unknown";
}

SolverSummary minimise(LeastSquaresProblem& problem, Eigen::VectorXd& state, const SolverOptions& options) {
  SolverSummary summary;
  double damping = options.initial_damping;
  std::optional<double> reached;  // the cost of the state, if it was the last cost computed
  while (summary.iterations < options.iterations) {
    double cost = problem.linearise(state);
    reached.reset();
    if (summary.iterations == 0) summary.initial_cost = cost;
    if (!std::isfinite(cost)) {
      summary.reason = ConvergenceReason::not_finite;
      break;
    }
    const double before = cost;
    double length = 0.0;
    if (!descend(problem, state, cost, length, damping, options.max_damping)) {
      summary.reason = ConvergenceReason::no_descent;
      break;
    }
    ++summary.iterations;
    reached = cost;
    if (length < options.parameter_tolerance) {
      summary.reason = ConvergenceReason::parameter_tolerance;
      break;
    }
    if (before - cost <= options.function_tolerance * before) {
      summary.reason = ConvergenceReason::function_tolerance;
      break;
    }
  }
  summary.final_cost = reached ? *reached : problem.cost(state);
  summary.terms = problem.term_costs();
  if (options.iterations <= 0) summary.initial_cost = summary.final_cost;
  return summary;
}

}  // namespace doppel
