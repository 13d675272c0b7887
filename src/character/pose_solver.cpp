#include "doppel/character/pose_solver.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace doppel {
namespace {

using Eigen::Affine3d;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

// What holds an undetermined DoF in place: metres that a metre or radian of change counts as. Small enough that a
// determined one does not feel it.
constexpr double kInertia = 0.01;

Vector3d rotation_error(const Matrix3d& actual, const Matrix3d& wanted) {
  const Eigen::AngleAxisd turn(Matrix3d(actual * wanted.transpose()));
  return turn.angle() * turn.axis();
}

}  // namespace

double reach_of_dof(const Skeleton& skeleton, int dof) {
  double sum = 0.0;
  for (const Dof::Drive& drive : skeleton.dofs.at(static_cast<std::size_t>(dof)).joints)
    sum += std::pow(drive.weight * skeleton.joints[static_cast<std::size_t>(drive.joint)].axis.norm(), 2);
  return std::sqrt(sum);
}

struct PoseSolver::Problem {
  const std::vector<PoseGoal>& goals;
  std::vector<double> start;
};

PoseSolver::PoseSolver(const Skeleton& skeleton, int iterations)
    : skeleton_(skeleton), iterations_(iterations), handles_(skeleton.joints.size()) {
  for (int d = 0; d < skeleton.num_dofs(); ++d) {
    for (const Dof::Drive& drive : skeleton.dofs[static_cast<std::size_t>(d)].joints) {
      const auto j = static_cast<std::size_t>(drive.joint);
      if (drive.weight != 0.0) handles_[j].push_back({drive.joint, d, drive.weight});
    }
    reach_.push_back(reach_of_dof(skeleton, d));
  }
}

void PoseSolver::within_limits(std::vector<double>& dofs) const {
  for (std::size_t d = 0; d < dofs.size(); ++d)
    if (const auto& limits = skeleton_.dofs[d].limits) dofs[d] = std::clamp(dofs[d], (*limits)[0], (*limits)[1]);
}

double PoseSolver::mean_distance(const std::vector<PoseGoal>& goals, const std::vector<double>& dofs) const {
  const std::vector<Affine3d> world = skeleton_.pose(dofs);
  double sum = 0.0;
  for (const PoseGoal& goal : goals)
    sum += (world[static_cast<std::size_t>(goal.joint)].translation() - goal.position).squaredNorm();
  return std::sqrt(sum / static_cast<double>(goals.size()));
}

double PoseSolver::cost(const Problem& problem, const std::vector<double>& dofs) const {
  const std::vector<Affine3d> world = skeleton_.pose(dofs);
  double sum = 0.0;
  for (const PoseGoal& goal : problem.goals) {
    const Affine3d& joint = world[static_cast<std::size_t>(goal.joint)];
    sum += goal.position_weight * (joint.translation() - goal.position).squaredNorm();
    sum += std::pow(goal.rotation_weight, 2) * rotation_error(joint.linear(), goal.rotation).squaredNorm();
  }
  for (std::size_t d = 0; d < dofs.size(); ++d) sum += std::pow(kInertia * reach_[d] * (dofs[d] - problem.start[d]), 2);
  return sum;
}

void PoseSolver::linearise(const Problem& problem, const std::vector<double>& dofs, MatrixXd& hessian,
                           VectorXd& gradient) const {
  const auto D = static_cast<Eigen::Index>(dofs.size());
  const std::vector<Affine3d> world = skeleton_.pose(dofs);
  hessian.setZero(D, D);
  gradient.setZero(D);
  MatrixXd jacobian(6, D);
  for (const PoseGoal& goal : problem.goals) {
    const Affine3d& at = world[static_cast<std::size_t>(goal.joint)];
    jacobian.setZero();
    for (int j = goal.joint; j >= 0; j = skeleton_.joints[static_cast<std::size_t>(j)].parent) {
      const Joint& joint = skeleton_.joints[static_cast<std::size_t>(j)];
      const Vector3d axis = world[static_cast<std::size_t>(j)].linear() * joint.axis;
      const Vector3d arm = at.translation() - world[static_cast<std::size_t>(j)].translation();
      for (const Handle& handle : handles_[static_cast<std::size_t>(j)]) {
        if (joint.type == Joint::Type::prismatic) {
          jacobian.col(handle.dof).head<3>() += handle.weight * axis;
        } else {
          jacobian.col(handle.dof).head<3>() += handle.weight * axis.cross(arm);
          jacobian.col(handle.dof).tail<3>() += handle.weight * axis;
        }
      }
    }
    Eigen::Matrix<double, 6, 1> residual;
    residual << std::sqrt(goal.position_weight) * (at.translation() - goal.position),
        goal.rotation_weight * rotation_error(at.linear(), goal.rotation);
    jacobian.topRows<3>() *= std::sqrt(goal.position_weight);
    jacobian.bottomRows<3>() *= goal.rotation_weight;
    hessian.noalias() += jacobian.transpose() * jacobian;
    gradient.noalias() += jacobian.transpose() * residual;
  }
  for (Eigen::Index d = 0; d < D; ++d) {
    const double inertia = std::pow(kInertia * reach_[static_cast<std::size_t>(d)], 2);
    hessian(d, d) += inertia;
    gradient[d] += inertia * (dofs[static_cast<std::size_t>(d)] - problem.start[static_cast<std::size_t>(d)]);
  }
}

/// DoFs that stand at a limit and want to go beyond it, and those that move nothing, take no part.
std::vector<double> PoseSolver::step(const std::vector<double>& dofs, const MatrixXd& hessian, const VectorXd& gradient,
                                     double damping) const {
  MatrixXd system = hessian;
  VectorXd right = -gradient;
  for (Eigen::Index d = 0; d < gradient.size(); ++d) {
    const auto at = static_cast<std::size_t>(d);
    const auto& limits = skeleton_.dofs[at].limits;
    const bool held =
        limits && ((dofs[at] <= (*limits)[0] && gradient[d] > 0) || (dofs[at] >= (*limits)[1] && gradient[d] < 0));
    if (held || reach_[at] == 0.0) {
      system.row(d).setZero();
      system.col(d).setZero();
      system(d, d) = 1.0;
      right[d] = 0.0;
    } else {
      system(d, d) *= 1.0 + damping;
    }
  }
  const VectorXd change = system.ldlt().solve(right);
  std::vector<double> next = dofs;
  for (std::size_t d = 0; d < next.size(); ++d) next[d] += change[static_cast<Eigen::Index>(d)];
  within_limits(next);
  return next;
}

double PoseSolver::solve(const std::vector<PoseGoal>& goals, std::vector<double>& dofs) const {
  within_limits(dofs);
  const Problem problem{goals, dofs};
  double current = cost(problem, dofs), damping = 1e-3;
  MatrixXd hessian;
  VectorXd gradient;
  for (int iteration = 0; iteration < iterations_; ++iteration) {
    linearise(problem, dofs, hessian, gradient);
    bool better = false;
    double gain = 0.0;
    while (!better && damping < 1e6) {
      std::vector<double> next = step(dofs, hessian, gradient, damping);
      const double found = cost(problem, next);
      better = found < current;
      damping = better ? std::max(1e-9, damping * 0.1) : damping * 10.0;
      if (!better) continue;
      gain = current - found;
      current = found;
      dofs = std::move(next);
    }
    if (!better || gain < 1e-8 * current + 1e-14) break;
  }
  return current;
}

}  // namespace doppel
