#include "doppel/view/inverse_kinematics.h"

#include <torch/types.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/layers/kinematics/kinematics.h"
#include "doppel/solver/least_squares.h"

namespace doppel {
namespace {

/// Whether a joint is on the way from the root to `descendant`, ends included.
bool carries(const Skeleton& skeleton, int joint, int descendant) {
  while (descendant > joint) descendant = skeleton.joints[as_size(descendant)].parent;
  return descendant == joint;
}

/// Joints that move the whole body: from the root on, as long as a joint has one child, and the first that branches.
std::vector<bool> whole_body(const Skeleton& skeleton) {
  std::vector<bool> whole(as_size(skeleton.num_joints()), false);
  for (int joint = 0; joint >= 0;) {
    whole[as_size(joint)] = true;
    int child = -1, children = 0;
    for (int j = 0; j < skeleton.num_joints(); ++j)
      if (skeleton.joints[as_size(j)].parent == joint) child = j, ++children;
    joint = children == 1 ? child : -1;
  }
  return whole;
}

/// DoFs that turn joints between the trunk and `joint`, and nothing else.
std::vector<int> free_dofs(const Skeleton& skeleton, int joint) {
  const std::vector<bool> whole = whole_body(skeleton);
  std::vector<int> found;
  for (std::size_t d = 0; d < skeleton.dofs.size(); ++d) {
    const auto& drives = skeleton.dofs[d].joints;
    const bool usable = std::all_of(drives.begin(), drives.end(), [&](const Dof::Drive& drive) {
      return skeleton.joints[as_size(drive.joint)].type == Joint::Type::revolute && !whole[as_size(drive.joint)];
    });
    const bool useful = std::any_of(drives.begin(), drives.end(), [&](const Dof::Drive& drive) {
      return drive.joint != joint && carries(skeleton, drive.joint, joint);
    });
    if (usable && useful) found.push_back(static_cast<int>(d));
  }
  return found;
}

/// The distance of a joint from a target, and of the pose from the initial one.
class ReachProblem : public LeastSquaresProblem {
 public:
  ReachProblem(const Character& character, const std::vector<double>& dofs, int joint, const Eigen::Vector3d& target,
               double stay)
      : skeleton_(character.skeleton),
        kinematics_(character),
        initial_(dofs),
        joint_(joint),
        target_(target),
        stay_(stay),
        free_(free_dofs(skeleton_, joint)) {}

  Eigen::VectorXd initial_state() const {
    Eigen::VectorXd state(static_cast<Eigen::Index>(free_.size()));
    for (std::size_t i = 0; i < free_.size(); ++i) state[as_row(i)] = initial_[as_size(free_[i])];
    return state;
  }

  std::vector<double> pose(const Eigen::VectorXd& state) const {
    std::vector<double> dofs = initial_;
    for (std::size_t i = 0; i < free_.size(); ++i) dofs[as_size(free_[i])] = state[as_row(i)];
    return dofs;
  }

  double distance(const Eigen::VectorXd& state) { return (position(frames(state), joint_) - target_).norm(); }

  double cost(const Eigen::VectorXd& state) override {
    double sum = (position(frames(state), joint_) - target_).squaredNorm();
    for (std::size_t i = 0; i < free_.size(); ++i) sum += std::pow(change(state, i), 2);
    return sum;
  }

  double linearise(const Eigen::VectorXd& state) override {
    const auto rows = as_row(free_.size());
    const torch::Tensor at = frames(state);
    const Eigen::Vector3d here = position(at, joint_);
    Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(3 + rows, rows);
    Eigen::VectorXd residual(3 + rows);
    residual.head<3>() = here - target_;
    for (std::size_t i = 0; i < free_.size(); ++i) {
      for (const Dof::Drive& drive : skeleton_.dofs[as_size(free_[i])].joints)
        if (drive.joint != joint_ && carries(skeleton_, drive.joint, joint_))
          jacobian.col(as_row(i)).head<3>() +=
              drive.weight * axis(at, drive.joint).cross(here - position(at, drive.joint));
      residual[3 + as_row(i)] = change(state, i);
      jacobian(3 + as_row(i), as_row(i)) = stay_ * radians(i);
    }
    normal_ = jacobian.transpose() * jacobian;
    gradient_ = jacobian.transpose() * residual;
    return residual.squaredNorm();
  }

  bool solve(double damping, Eigen::VectorXd& step) override {
    Eigen::MatrixXd damped = normal_;
    damped.diagonal() += damping * normal_.diagonal();
    const Eigen::LDLT<Eigen::MatrixXd> factor(damped);
    if (factor.info() != Eigen::Success) return false;
    step = -factor.solve(gradient_);
    return step.allFinite();
  }

  Eigen::VectorXd moved(const Eigen::VectorXd& state, const Eigen::VectorXd& step) const override {
    Eigen::VectorXd result = state + step;
    for (std::size_t i = 0; i < free_.size(); ++i)
      if (const auto& limits = skeleton_.dofs[as_size(free_[i])].limits)
        result[as_row(i)] = std::clamp(result[as_row(i)], (*limits)[0], (*limits)[1]);
    return result;
  }

  std::vector<TermCost> term_costs() const override { return {}; }

 private:
  static Eigen::Index as_row(std::size_t i) { return static_cast<Eigen::Index>(i); }

  /// World-from-joint transforms, [J,3,4].
  torch::Tensor frames(const Eigen::VectorXd& state) const {
    const std::vector<double> dofs = pose(state);
    return kinematics_->joints(torch::tensor(dofs, torch::kFloat64).unsqueeze(0))[0].contiguous();
  }
  static Eigen::Vector3d column(const torch::Tensor& frames, int joint, int column) {
    const double* m = frames.data_ptr<double>() + 12 * joint;
    return {m[column], m[4 + column], m[8 + column]};
  }
  static Eigen::Vector3d position(const torch::Tensor& frames, int joint) { return column(frames, joint, 3); }
  Eigen::Vector3d axis(const torch::Tensor& frames, int joint) const {
    const Eigen::Vector3d& local = skeleton_.joints[as_size(joint)].axis;
    return column(frames, joint, 0) * local.x() + column(frames, joint, 1) * local.y() +
           column(frames, joint, 2) * local.z();
  }
  /// Radians of one unit of a DoF.
  double radians(std::size_t i) const { return std::abs(skeleton_.dofs[as_size(free_[i])].joints.front().weight); }
  double change(const Eigen::VectorXd& state, std::size_t i) const {
    return stay_ * radians(i) * (state[as_row(i)] - initial_[as_size(free_[i])]);
  }

  const Skeleton& skeleton_;
  Kinematics kinematics_;
  std::vector<double> initial_;
  int joint_;
  Eigen::Vector3d target_;
  double stay_;
  std::vector<int> free_;
  Eigen::MatrixXd normal_;
  Eigen::VectorXd gradient_;
};

}  // namespace

ReachResult reach(const Character& character, const std::vector<double>& dofs, int joint, const Eigen::Vector3d& target,
                  const ReachOptions& options) {
  if (static_cast<int>(dofs.size()) != character.num_dofs())
    fail<UsageError>("reaching: the character has {} DoFs, the pose {}", character.num_dofs(), dofs.size());
  if (joint < 0 || joint >= character.skeleton.num_joints())
    fail<UsageError>("reaching: joint {} does not exist, allowed are 0..{}", joint,
                     character.skeleton.num_joints() - 1);
  if (!target.allFinite() || !std::all_of(dofs.begin(), dofs.end(), [](double d) { return std::isfinite(d); }))
    fail<UsageError>("reaching: the pose or the target is not finite");
  const torch::NoGradGuard no_grad;
  ReachProblem problem(character, dofs, joint, target, options.stay);
  Eigen::VectorXd state = problem.initial_state();
  SolverOptions solver;
  solver.iterations = options.iterations;
  solver.function_tolerance = 1e-6;
  if (state.size() > 0) minimise(problem, state, solver);
  return {problem.pose(state), problem.distance(state)};
}

}  // namespace doppel
