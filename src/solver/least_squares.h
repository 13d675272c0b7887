#pragma once

/// Minimises sums of squares. The loop does not depend on characters or on a form of the matrix: a problem computes the
/// cost of a state, linearises its residuals there and proposes a step. A problem may take the step from dense normal
/// equations (`dense_system.h`), from a sparse factorisation, or from an iteration that never forms the matrix.

#include <Eigen/Core>
#include <string>
#include <vector>

namespace doppel {

/// Why a minimisation ended.
enum class ConvergenceReason {
  function_tolerance,   ///< converged: the last step lowered the cost by less than the function tolerance
  parameter_tolerance,  ///< converged: the last step changed the unknowns by less than the parameter tolerance
  no_descent,           ///< no damping gave a step that lowers the cost: a minimum, or a wrong jacobian
  iteration_limit,      ///< all allowed steps were taken
  not_finite,           ///< the cost at the start is not finite; the state is unchanged
};
std::string to_string(ConvergenceReason reason);

/// The cost of one term of the energy.
struct TermCost {
  std::string name;
  double cost = 0.0;
};

class LeastSquaresProblem {
 public:
  virtual ~LeastSquaresProblem() = default;
  virtual double cost(const Eigen::VectorXd& state) = 0;
  /// Computes residuals, jacobian, and everything else that stays constant until the next call, at `state`.
  /// @return the cost there; `cost` of the same state returns the same value until the next call
  virtual double linearise(const Eigen::VectorXd& state) = 0;
  /// Solves (J^T J + damping diag(J^T J)) step = -J^T r at the last linearisation.
  /// @return false when the system cannot be solved at this damping
  virtual bool solve(double damping, Eigen::VectorXd& step) = 0;
  /// The state after a step. A problem with rotations in its state overrides the sum.
  virtual Eigen::VectorXd moved(const Eigen::VectorXd& state, const Eigen::VectorXd& step) const {
    return state + step;
  }
  /// The cost of each term at the state of the last call of `linearise` or `cost`.
  virtual std::vector<TermCost> term_costs() const = 0;
};

struct SolverOptions {
  int iterations = 20;                ///< largest number of steps
  double initial_damping = 1e-3;      ///< of Levenberg and Marquardt, relative to the diagonal
  double max_damping = 1e6;           ///< the solve ends when no step lowers the cost up to this damping
  double function_tolerance = 1e-4;   ///< relative decrease of the cost below which a step is the last
  double parameter_tolerance = 1e-7;  ///< largest change of the unknowns below which a step is the last
};

struct SolverSummary {
  ConvergenceReason reason = ConvergenceReason::iteration_limit;
  int iterations = 0;  ///< steps taken
  double initial_cost = 0.0, final_cost = 0.0;
  std::vector<TermCost> terms;  ///< at the end
};

/// Minimises with Gauss-Newton steps and Levenberg-Marquardt damping. A new state replaces `state` only if it costs
/// less under the same linearisation. The result is therefore never worse than the start, and holds no NaN unless the
/// start did.
SolverSummary minimise(LeastSquaresProblem& problem, Eigen::VectorXd& state, const SolverOptions& options = {});

}  // namespace doppel
