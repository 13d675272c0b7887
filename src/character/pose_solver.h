#pragma once

#include <Eigen/Core>
#include <vector>

#include "doppel/character/skeleton.h"

namespace doppel {

/// How far the joints of a DoF move per unit of it: radians and metres, root of the sum of squares.
double reach_of_dof(const Skeleton& skeleton, int dof);

/// Where a joint should be and how it should be turned.
struct PoseGoal {
  int joint = 0;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();      ///< world metres
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< world from joint
  double position_weight = 1.0;                            ///< in the sum of squares
  double rotation_weight = 0.1;                            ///< metres that a radian counts as
};

/// Finds the DoFs that bring joints to goals: Gauss-Newton with Levenberg-Marquardt damping in double precision, within
/// the DoFs' limits. A DoF that the goals leave open stays where it was.
class PoseSolver {
 public:
  /// @param iterations at most, for one pose
  explicit PoseSolver(const Skeleton& skeleton, int iterations = 30);

  /// @param dofs [D] in: where to begin (brought within the limits first); out: the solution
  /// @return the sum of squares that is left
  double solve(const std::vector<PoseGoal>& goals, std::vector<double>& dofs) const;
  /// Root mean square distance of the joints from their goals, metres.
  double mean_distance(const std::vector<PoseGoal>& goals, const std::vector<double>& dofs) const;

 private:
  struct Problem;
  /// One DoF's hold on a joint of the skeleton.
  struct Handle {
    int joint, dof;
    double weight;
  };
  void within_limits(std::vector<double>& dofs) const;
  double cost(const Problem& problem, const std::vector<double>& dofs) const;
  void linearise(const Problem& problem, const std::vector<double>& dofs, Eigen::MatrixXd& hessian,
                 Eigen::VectorXd& gradient) const;
  std::vector<double> step(const std::vector<double>& dofs, const Eigen::MatrixXd& hessian,
                           const Eigen::VectorXd& gradient, double damping) const;

  const Skeleton& skeleton_;
  int iterations_;
  std::vector<std::vector<Handle>> handles_;  ///< [J] of the joint alone
  std::vector<double> reach_;                 ///< [D] metres or radians per unit of the DoF
};

}  // namespace doppel
