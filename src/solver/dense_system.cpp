#include "doppel/solver/dense_system.h"

#include <Eigen/Cholesky>

namespace doppel {

void DenseSystem::reset(Eigen::Index num_unknowns) {
  hessian_.setZero(num_unknowns, num_unknowns);
  gradient_.setZero(num_unknowns);
}

bool DenseSystem::solve(double damping, Eigen::VectorXd& step) const {
  Eigen::MatrixXd damped = hessian_;
  for (Eigen::Index i = 0; i < damped.rows(); ++i)
    damped(i, i) = damped(i, i) > 0.0 ? damped(i, i) * (1.0 + damping) : 1.0;
  const Eigen::LLT<Eigen::MatrixXd, Eigen::Lower> factor(damped);
  if (factor.info() != Eigen::Success) return false;
  step = factor.solve(-gradient_);
  return step.allFinite();
}

}  // namespace doppel
