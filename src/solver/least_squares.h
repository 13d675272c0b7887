#pragma once

/// Minimises sums of squares. The loop here knows neither characters nor matrices: a problem says how much a state
/// costs, linearises itself there and proposes a step. How it finds the step is its own affair: from dense normal
/// equations (`dense_system.h`), by a sparse factorisation, or without ever forming a matrix.

#include <Eigen/Core>
#include <string>
#include <vector>

namespace doppel {

/// Why a minimisation ended.
enum class ConvergenceReason {
  function_tolerance,   ///< converged: the last step lowered the cost by next to nothing
  parameter_tolerance,  ///< converged: the last step moved the unknowns by next to nothing
  no_descent,           ///< no damping gave a step that gains: a minimum to working precision, or a wrong jacobian
  iteration_limit,      ///< all allowed steps were taken
  not_finite,           ///< the cost at the start is not a number: nothing was changed
};
std::string to_string(ConvergenceReason reason);

/// What one part of the energy costs.
struct TermCost {
  std::string name;
  double cost = 0.0;
};

class LeastSquaresProblem {
 public:
  virtual ~LeastSquaresProblem() = default;
  virtual double cost(const Eigen::VectorXd& state) = 0;
  /// Gets ready to step from `state`: residuals, jacobian, and all that stays frozen until the next call.
  /// @return the cost there; `cost` of the same state gives the same until the next call
  virtual double linearise(const Eigen::VectorXd& state) = 0;
  /// Solves (J^T J + damping diag(J^T J)) step = -J^T r of the last linearisation.
  /// @return false when the system cannot be solved at this damping
  virtual bool solve(double damping, Eigen::VectorXd& step) = 0;
  /// The state after a step. States with rotations in them do not simply add.
  virtual Eigen::VectorXd moved(const Eigen::VectorXd& state, const Eigen::VectorXd& step) const {
    return state + step;
  }
  /// The cost of each term at the state last linearised or asked for by `cost`.
  virtual std::vector<TermCost> term_costs() const = 0;
};

struct SolverOptions {
  int iterations = 20;            ///< steps at most
  double initial_damping = 1e-3;  ///< of Levenberg and Marquardt, relative to the diagonal
  double max_damping = 1e6;   ///< no step gains at this damping: give up
  double function_tolerance = 1e-4;    ///< a step that gains less than this share of the cost is the last one
  double parameter_tolerance = 1e-7;    ///< and one that moves no unknown farther than this
};

struct SolverSummary {
  ConvergenceReason reason = ConvergenceReason::iteration_limit;
  int iterations = 0;  ///< steps taken
  double initial_cost = 0.0, final_cost = 0.0;
  std::vector<TermCost> terms;  ///< at the end
};

/// Gauss-Newton steps with Levenberg-Marquardt damping. The state only ever changes for one that costs less under the
/// same linearisation, so it is never worse than the start and never holds a NaN that the start did not hold.
SolverSummary minimise(LeastSquaresProblem& problem, Eigen::VectorXd& state, const SolverOptions& options = {});

}  // namespace doppel
