#pragma once

#include <Eigen/Core>

namespace doppel {

/// Preconditioned conjugate gradients for A x = b with A symmetric and positive definite, from x = 0. After any number
/// of iterations, x is a descent direction from 0. `System` defines A:
///   void multiply(const Eigen::VectorXd& x, Eigen::VectorXd& image) const;        A x
///   void precondition(const Eigen::VectorXd& x, Eigen::VectorXd& result) const;   about A^-1 x
///   double dot(const Eigen::VectorXd& a, const Eigen::VectorXd& b) const;
/// @param tolerance the iteration ends when the length of the residual, relative to that of b, is below it
template <typename System>
void conjugate_gradients(const System& system, const Eigen::VectorXd& b, int iterations, double tolerance,
                         Eigen::VectorXd& x) {
  x.setZero(b.size());
  Eigen::VectorXd residual = b, preconditioned, direction, image;
  system.precondition(residual, preconditioned);
  direction = preconditioned;
  const double enough = tolerance * tolerance * system.dot(b, b);
  double before = system.dot(residual, preconditioned);
  for (int i = 0; i < iterations && system.dot(residual, residual) > enough; ++i) {
    system.multiply(direction, image);
    const double curvature = system.dot(direction, image);
    if (!(curvature > 0.0)) return;
    const double length = before / curvature;
    x += length * direction;
    residual -= length * image;
    system.precondition(residual, preconditioned);
    const double after = system.dot(residual, preconditioned);
    direction = preconditioned + after / before * direction;
    before = after;
  }
}

}  // namespace doppel
