#pragma once

#include <memory>
#include <vector>

#include "doppel/track/solver/dense_system.h"
#include "doppel/track/solver/least_squares.h"
#include "doppel/track/terms/term.h"

namespace doppel {

/// The energy of a pose (4.2): a sum of terms over one character. The state is the whole DoF vector [D]; only the
/// model's unknowns change.
class PoseProblem : public LeastSquaresProblem {
 public:
  /// @param model must outlive the problem
  PoseProblem(const PoseModel& model, std::vector<std::unique_ptr<PoseTerm>> terms);

  double cost(const Eigen::VectorXd& state) override;
  double linearise(const Eigen::VectorXd& state) override;
  bool solve(double damping, Eigen::VectorXd& step) override;
  Eigen::VectorXd moved(const Eigen::VectorXd& state, const Eigen::VectorXd& step) const override;
  std::vector<TermCost> term_costs() const override { return costs_; }

  const DenseSystem& system() const { return system_; }

 private:
  const PoseModel& model_;
  std::vector<std::unique_ptr<PoseTerm>> terms_;
  DenseSystem system_;
  Residuals rows_;
  std::vector<TermCost> costs_;
};

/// Fits a pose. @param dofs [D] in: where to begin; out: the solution
SolverSummary fit_pose(const PoseModel& model, std::vector<std::unique_ptr<PoseTerm>> terms, std::vector<double>& dofs,
                       const SolverOptions& options = {});

}  // namespace doppel
