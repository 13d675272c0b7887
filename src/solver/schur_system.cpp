#include "doppel/solver/schur_system.h"

#include <Eigen/Cholesky>

namespace doppel {
namespace {

constexpr double kGroupDamping = 1e-9;  // of groups whose equations may be singular

/// The matrix with a larger diagonal; a zero on the diagonal becomes 1, so that the unknown keeps its value.
Eigen::MatrixXd damped(Eigen::MatrixXd matrix, double damping) {
  for (Eigen::Index i = 0; i < matrix.rows(); ++i)
    matrix(i, i) = matrix(i, i) == 0.0 ? 1.0 : matrix(i, i) * (1.0 + damping);
  return matrix;
}

}  // namespace

void SchurSystem::reset(Eigen::Index num_shared, const std::vector<int>& sizes) {
  hessian_.setZero(num_shared, num_shared);
  gradient_.setZero(num_shared);
  groups_.resize(sizes.size());
  for (std::size_t g = 0; g < sizes.size(); ++g) {
    groups_[g].hessian.setZero(sizes[g], sizes[g]);
    groups_[g].cross.setZero(sizes[g], num_shared);
    groups_[g].gradient.setZero(sizes[g]);
  }
}

bool SchurSystem::solve(double damping, Eigen::VectorXd& step) const {
  Eigen::MatrixXd reduced = damped(hessian_, damping);
  Eigen::VectorXd right = -gradient_;
  std::vector<Eigen::LLT<Eigen::MatrixXd>> factors;
  factors.reserve(groups_.size());
  Eigen::Index unknowns = num_shared();
  for (const Group& group : groups_) {
    factors.emplace_back(damped(group.hessian, damping));
    if (factors.back().info() != Eigen::Success) return false;
    // cross^T H^-1 cross as the square of L^-1 cross.
    const Eigen::MatrixXd half = factors.back().matrixL().solve(group.cross);
    reduced.selfadjointView<Eigen::Lower>().rankUpdate(half.transpose(), -1.0);
    right += half.transpose() * factors.back().matrixL().solve(group.gradient);
    unknowns += group.gradient.size();
  }
  const Eigen::LLT<Eigen::MatrixXd, Eigen::Lower> factor(reduced);
  if (factor.info() != Eigen::Success) return false;
  step.resize(unknowns);
  step.head(num_shared()) = factor.solve(right);
  Eigen::Index begin = num_shared();
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const Eigen::Index size = groups_[g].gradient.size();
    step.segment(begin, size) = -factors[g].solve(groups_[g].gradient + groups_[g].cross * step.head(num_shared()));
    begin += size;
  }
  return step.allFinite();
}

Eigen::MatrixXd SchurSystem::reduced_hessian() const {
  Eigen::MatrixXd reduced = hessian_;
  for (const Group& group : groups_) {
    const Eigen::LLT<Eigen::MatrixXd> factor(damped(group.hessian, kGroupDamping));
    if (factor.info() != Eigen::Success) continue;
    const Eigen::MatrixXd half = factor.matrixL().solve(group.cross);
    reduced.noalias() -= half.transpose() * half;
  }
  return reduced;
}

std::vector<Eigen::VectorXd> SchurSystem::reduced_gradients() const {
  std::vector<Eigen::VectorXd> gradients;
  gradients.reserve(groups_.size());
  for (const Group& group : groups_) {
    const Eigen::LLT<Eigen::MatrixXd> factor(damped(group.hessian, kGroupDamping));
    gradients.push_back(factor.info() == Eigen::Success
                            ? Eigen::VectorXd(-group.cross.transpose() * factor.solve(group.gradient))
                            : Eigen::VectorXd(Eigen::VectorXd::Zero(num_shared())));
  }
  return gradients;
}

}  // namespace doppel
