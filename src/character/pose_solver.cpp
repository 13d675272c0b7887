#include "doppel/character/pose_solver.h"

#include <algorithm>
#include <cmath>

#include "doppel/core/as_size.h"
#include "doppel/geometry/decompositions.h"
#include "doppel/solver/least_squares.h"

namespace doppel {
namespace {

using Eigen::Affine3d;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

// Keeps an undetermined DoF in place: metres that a metre or radian of change counts as. Too small to move a DoF that
// the goals determine.
constexpr double kInertia = 0.01;
constexpr double kFunctionTolerance = 1e-8;

Vector3d rotation_error(const Matrix3d& actual, const Matrix3d& wanted) {
  const Eigen::AngleAxisd turn(Matrix3d(actual * wanted.transpose()));
  return turn.angle() * turn.axis();
}

std::vector<double> to_vector(const VectorXd& values) { return {values.data(), values.data() + values.size()}; }

/// Distances of joints from their goals, and changes of DoFs from the start, as a least-squares problem over all DoFs.
class PoseGoalProblem : public LeastSquaresProblem {
 public:
  PoseGoalProblem(const Skeleton& skeleton, const std::vector<PoseGoal>& goals, const VectorXd& start)
      : skeleton_(skeleton), goals_(goals), start_(start), reach_(start.size()), handles_(skeleton.joints.size()) {
    for (int d = 0; d < skeleton.num_dofs(); ++d) {
      for (const Dof::Drive& drive : skeleton.dofs[d].joints)
        if (drive.weight != 0.0) handles_[drive.joint].push_back({d, drive.weight});
      reach_[d] = reach_of_dof(skeleton, d);
    }
  }

  double cost(const VectorXd& dofs) override {
    const std::vector<Affine3d> world = skeleton_.pose(to_vector(dofs));
    double sum = (kInertia * reach_.cwiseProduct(dofs - start_)).squaredNorm();
    for (const PoseGoal& goal : goals_) sum += residual(goal, world[goal.joint]).squaredNorm();
    return sum;
  }

  double linearise(const VectorXd& dofs) override {
    const std::vector<Affine3d> world = skeleton_.pose(to_vector(dofs));
    const VectorXd inertia = kInertia * reach_, moved = inertia.cwiseProduct(dofs - start_);
    dofs_ = dofs;
    hessian_ = inertia.cwiseAbs2().asDiagonal();
    gradient_ = inertia.cwiseProduct(moved);
    double sum = moved.squaredNorm();
    for (const PoseGoal& goal : goals_) {
      const MatrixXd rows = jacobian(goal, world);
      const Residual errors = residual(goal, world[goal.joint]);
      hessian_.noalias() += rows.transpose() * rows;
      gradient_.noalias() += rows.transpose() * errors;
      sum += errors.squaredNorm();
    }
    return sum;
  }

  /// Keeps a DoF that the step would push beyond its limit, and one that moves no joint.
  bool solve(double damping, VectorXd& step) override {
    MatrixXd system = hessian_;
    VectorXd right = -gradient_;
    for (Eigen::Index d = 0; d < right.size(); ++d) {
      if (is_held(d)) {
        system.row(d).setZero();
        system.col(d).setZero();
        system(d, d) = 1.0;
        right[d] = 0.0;
      } else {
        system(d, d) *= 1.0 + damping;
      }
    }
    step = solve_symmetric(system, right);
    return true;
  }

  VectorXd moved(const VectorXd& dofs, const VectorXd& step) const override {
    return within_limits(skeleton_, dofs + step);
  }
  std::vector<TermCost> term_costs() const override { return {}; }

  static VectorXd within_limits(const Skeleton& skeleton, VectorXd dofs) {
    for (Eigen::Index d = 0; d < dofs.size(); ++d)
      if (const auto& limits = skeleton.dofs[d].limits) dofs[d] = std::clamp(dofs[d], (*limits)[0], (*limits)[1]);
    return dofs;
  }

 private:
  using Residual = Eigen::Matrix<double, 6, 1>;
  /// A DoF that drives a joint.
  struct Handle {
    int dof;
    double weight;
  };

  static Residual residual(const PoseGoal& goal, const Affine3d& joint) {
    Residual errors;
    errors << std::sqrt(goal.position_weight) * (joint.translation() - goal.position),
        goal.rotation_weight * rotation_error(joint.linear(), goal.rotation);
    return errors;
  }

  /// [6,D]
  MatrixXd jacobian(const PoseGoal& goal, const std::vector<Affine3d>& world) const {
    MatrixXd rows = MatrixXd::Zero(6, start_.size());
    const Vector3d target = world[goal.joint].translation();
    for (int j = goal.joint; j >= 0; j = skeleton_.joints[j].parent) {
      const Joint& joint = skeleton_.joints[j];
      const Vector3d axis = world[j].linear() * joint.axis;
      const Vector3d arm = target - world[j].translation();
      for (const Handle& handle : handles_[j]) {
        if (joint.type == Joint::Type::prismatic) {
          rows.col(handle.dof).head<3>() += handle.weight * axis;
        } else {
          rows.col(handle.dof).head<3>() += handle.weight * axis.cross(arm);
          rows.col(handle.dof).tail<3>() += handle.weight * axis;
        }
      }
    }
    rows.topRows<3>() *= std::sqrt(goal.position_weight);
    rows.bottomRows<3>() *= goal.rotation_weight;
    return rows;
  }

  bool is_held(Eigen::Index d) const {
    if (reach_[d] == 0.0) return true;
    const auto& limits = skeleton_.dofs[d].limits;
    return limits && ((dofs_[d] <= (*limits)[0] && gradient_[d] > 0) || (dofs_[d] >= (*limits)[1] && gradient_[d] < 0));
  }

  const Skeleton& skeleton_;
  const std::vector<PoseGoal>& goals_;
  VectorXd start_, reach_;                    ///< [D] reach: metres or radians per unit of the DoF
  std::vector<std::vector<Handle>> handles_;  ///< [J]
  // Of the last linearisation:
  VectorXd dofs_, gradient_;
  MatrixXd hessian_;
};

}  // namespace

double reach_of_dof(const Skeleton& skeleton, int dof) {
  double sum = 0.0;
  for (const Dof::Drive& drive : skeleton.dofs.at(as_size(dof)).joints)
    sum += std::pow(drive.weight * skeleton.joints[drive.joint].axis.norm(), 2);
  return std::sqrt(sum);
}

double PoseSolver::mean_distance(const std::vector<PoseGoal>& goals, const std::vector<double>& dofs) const {
  const std::vector<Affine3d> world = skeleton_.pose(dofs);
  double sum = 0.0;
  for (const PoseGoal& goal : goals) sum += (world[goal.joint].translation() - goal.position).squaredNorm();
  return std::sqrt(sum / static_cast<double>(goals.size()));
}

double PoseSolver::solve(const std::vector<PoseGoal>& goals, std::vector<double>& dofs) const {
  const Eigen::Map<const VectorXd> given(dofs.data(), static_cast<Eigen::Index>(dofs.size()));
  VectorXd state = PoseGoalProblem::within_limits(skeleton_, given);
  PoseGoalProblem problem(skeleton_, goals, state);
  SolverOptions options;
  options.iterations = iterations_;
  options.function_tolerance = kFunctionTolerance;
  options.parameter_tolerance = 0.0;
  const SolverSummary summary = minimise(problem, state, options);
  dofs = to_vector(state);
  return summary.final_cost;
}

}  // namespace doppel
