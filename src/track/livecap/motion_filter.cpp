#include "doppel/track/livecap/motion_filter.h"

#include <Eigen/Cholesky>
#include <limits>

namespace doppel {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kFirstVelocity = 30.0;  // standard deviation of the first velocity, in those of its change

/// Of a symmetric matrix; not a number when it is not positive definite.
MatrixXd inverse_of(const MatrixXd& lower_half) {
  const Eigen::LLT<MatrixXd, Eigen::Lower> factor(lower_half);
  if (factor.info() != Eigen::Success) return MatrixXd::Constant(1, 1, std::numeric_limits<double>::quiet_NaN());
  return factor.solve(MatrixXd::Identity(lower_half.rows(), lower_half.cols()));
}

MatrixXd symmetric(const MatrixXd& matrix) { return 0.5 * (matrix + matrix.transpose()); }

}  // namespace

VectorXd MotionFilter::noise(const PoseModel& model) const {
  VectorXd variances(model.num_unknowns());
  for (int u = 0; u < model.num_unknowns(); ++u) {
    const std::optional<int> dof = model.dof_of(u);
    const bool shifts = dof && model.moves_root(*dof);
    // A DoF that drives no joint does not matter.
    const double reach = dof && model.reach(*dof) > 0.0 ? model.reach(*dof) : 1.0;
    variances[u] = 1.0 / ((shifts ? options_.shift_weight : options_.turn_weight) * reach * reach);
  }
  return variances;
}

MotionFilter::Prediction MotionFilter::predicted(const PoseModel& model) const {
  Prediction next;
  next.dofs = model.moved(dofs_, velocity_);
  next.covariance = of_pose_ + of_pose_velocity_ + of_pose_velocity_.transpose() + of_velocity_;
  next.covariance.diagonal() += noise(model);
  return next;
}

void MotionFilter::start(const PoseModel& model, const std::vector<double>& dofs, const MatrixXd& hessian) {
  const Eigen::Index n = model.num_unknowns();
  dofs_ = dofs;
  velocity_.setZero(n);
  of_pose_ = inverse_of(hessian);
  of_pose_velocity_.setZero(n, n);
  of_velocity_ = (kFirstVelocity * kFirstVelocity * noise(model)).asDiagonal();
  if (!of_pose_.allFinite()) clear();
}

void MotionFilter::add(const PoseModel& model, const std::vector<double>& dofs, const MatrixXd& hessian) {
  const Prediction before = predicted(model);
  MatrixXd velocity = of_velocity_;
  velocity.diagonal() += noise(model);
  const MatrixXd pose_velocity = of_pose_velocity_ + velocity;  // of x' and v'
  // The regression of the velocity on the pose.
  const MatrixXd gain = Eigen::LLT<MatrixXd>(before.covariance).solve(pose_velocity).transpose();
  const MatrixXd found = inverse_of(hessian);
  if (!found.allFinite()) return clear();
  velocity_ += gain * model.step_between(before.dofs, dofs);
  of_velocity_ = symmetric(velocity - gain * (before.covariance - found) * gain.transpose());
  of_pose_velocity_ = found * gain.transpose();
  of_pose_ = symmetric(found);
  dofs_ = dofs;
  if (!of_velocity_.allFinite()) clear();
}

}  // namespace doppel
