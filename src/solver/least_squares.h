#pragma once

/// Minimises sums of squares, with robust kernels if the problem has them. The loop knows neither characters nor
/// matrices. A problem computes the cost of a state, linearises its residuals at a state, and proposes a step. It may
/// compute the step from dense normal equations (`dense_system.h`), from a sparse factorisation, or with an iteration
/// that never forms the matrix.
///
/// Notation: r residuals and J their jacobian with respect to the unknowns, both multiplied by the square roots of the
/// weights. The cost is the sum of the weighted squared residuals, under their robust kernels.

#include <Eigen/Core>
#include <string>
#include <vector>

namespace doppel {

/// Why a minimisation ended.
enum class ConvergenceReason {
  function_tolerance,   ///< converged: the relative decrease of the cost in the last step is within the tolerance
  parameter_tolerance,  ///< converged: the last step changed every unknown by less than the tolerance
  no_descent,           ///< no damping gave a step that lowers the cost: a minimum is reached, or the jacobian is wrong
  iteration_limit,      ///< all allowed steps were taken
  not_finite,           ///< `linearise` returned a cost that is not finite; no step is taken from that state
};
/// The reason in words, for example "function tolerance".
std::string to_string(ConvergenceReason reason);

/// The cost of one term of the energy, weight included.
struct TermCost {
  std::string name;
  double cost = 0.0;
};

/// What `minimise` needs of a problem. The state may hold more numbers than there are unknowns, for example all DoFs of
/// a pose of which some are fixed.
class LeastSquaresProblem {
 public:
  virtual ~LeastSquaresProblem() = default;
  /// The cost of a state, with everything that the last `linearise` fixed. May be infinite or NaN; such a state is
  /// never accepted.
  virtual double cost(const Eigen::VectorXd& state) = 0;
  /// Computes residuals and jacobian at `state`. Also fixes what depends on the state but stays constant until the next
  /// call, for example correspondences.
  /// @return the cost of `state`. Until the next call, `cost(state)` returns the same value.
  virtual double linearise(const Eigen::VectorXd& state) = 0;
  /// Solves (J^T J + damping diag(J^T J)) step = -J^T r at the last linearisation.
  /// @param step out: one number for each unknown
  /// @return false when the system cannot be solved with this damping; the loop then raises the damping
  virtual bool solve(double damping, Eigen::VectorXd& step) = 0;
  /// The state after a step. The default is the sum. A problem overrides it when its state holds rotations, or when
  /// state and step differ in size.
  virtual Eigen::VectorXd moved(const Eigen::VectorXd& state, const Eigen::VectorXd& step) const {
    return state + step;
  }
  /// The cost of each term at the state of the last call of `linearise` or `cost`.
  virtual std::vector<TermCost> term_costs() const = 0;
};

struct SolverOptions {
  int iterations = 20;                ///< largest number of steps; 0: only the costs of the state are computed
  double initial_damping = 1e-3;      ///< of Levenberg and Marquardt, relative to the diagonal of J^T J
  double max_damping = 1e6;           ///< the minimisation ends when no damping up to this lowers the cost
  double function_tolerance = 1e-4;   ///< the minimisation ends when a step lowers the cost by this share or less
  double parameter_tolerance = 1e-7;  ///< the minimisation ends when a step changes every unknown by less than this
};

struct SolverSummary {
  ConvergenceReason reason = ConvergenceReason::iteration_limit;
  int iterations = 0;                           ///< steps taken
  double initial_cost = 0.0, final_cost = 0.0;  ///< of the initial and of the final state
  std::vector<TermCost> terms;                  ///< the cost of each term at the final state
};

/// Minimises with Gauss-Newton steps and Levenberg-Marquardt damping. A step is taken only if it lowers the cost with
/// everything that the last `linearise` fixed. For a problem that fixes nothing, the final cost is therefore never
/// higher than the initial one. A step that is not finite is never taken.
/// @param state in: the initial state; out: the final state
/// @return reason and costs; it does not throw when the minimisation fails
SolverSummary minimise(LeastSquaresProblem& problem, Eigen::VectorXd& state, const SolverOptions& options = {});

}  // namespace doppel
