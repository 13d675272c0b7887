#pragma once

#include <Eigen/Core>

#include "doppel/solver/residuals.h"

namespace doppel {

/// Normal equations of a problem with some tens or hundreds of unknowns.
class DenseSystem {
 public:
  void reset(Eigen::Index num_unknowns);
  /// Adds the rows of a term. It overwrites them: call `reset` before the next use.
  void add(Residuals& residuals) { residuals.add_to(hessian_, gradient_); }
  /// Adds the equations of another problem with the same unknowns.
  void add(const DenseSystem& other) {
    hessian_ += other.hessian_;
    gradient_ += other.gradient_;
  }

  /// Solves (H + damping diag(H)) step = -gradient. An unknown on which no row depends keeps its value.
  /// @return false when the system is not positive definite or not finite
  bool solve(double damping, Eigen::VectorXd& step) const;

  /// H x
  Eigen::VectorXd product(const Eigen::VectorXd& x) const { return hessian_.selfadjointView<Eigen::Lower>() * x; }
  /// Only the lower half is filled.
  const Eigen::MatrixXd& hessian() const { return hessian_; }
  const Eigen::VectorXd& gradient() const { return gradient_; }

 private:
  Eigen::MatrixXd hessian_;
  Eigen::VectorXd gradient_;
};

}  // namespace doppel
