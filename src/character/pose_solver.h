#pragma once

#include <Eigen/Core>
#include <vector>

#include "doppel/character/skeleton.h"

namespace doppel {

/// The motion of a DoF's joints per unit of the DoF: radians and metres, root of the sum of squares.
double reach_of_dof(const Skeleton& skeleton, int dof);

/// The desired position and rotation of a joint.
struct PoseGoal {
  int joint = 0;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();      ///< world metres
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< world from joint
  double position_weight = 1.0;                            ///< weight in the sum of squares
  double rotation_weight = 0.1;                            ///< metres per radian
};

/// Finds the DoFs that bring joints to goals, by `minimise` in double precision, within the limits of the DoFs. A DoF
/// that the goals leave open keeps its value.
class PoseSolver {
 public:
  /// @param skeleton must outlive the solver @param iterations at most, for one pose
  explicit PoseSolver(const Skeleton& skeleton, int iterations = 30) : skeleton_(skeleton), iterations_(iterations) {}

  /// @param dofs [D] in: the start, which is clamped to the limits first; out: the solution
  /// @return the remaining sum of squares
  double solve(const std::vector<PoseGoal>& goals, std::vector<double>& dofs) const;
  /// Root mean square distance of the joints from their goals, metres.
  double mean_distance(const std::vector<PoseGoal>& goals, const std::vector<double>& dofs) const;

 private:
  const Skeleton& skeleton_;
  int iterations_;
};

}  // namespace doppel
