#pragma once

#include <Eigen/Core>
#include <vector>

#include "doppel/character/character.h"

namespace doppel {

struct ReachOptions {
  int iterations = 60;
  double stay = 1e-3;  ///< metres of distance that one radian away from the initial pose is worth
};

struct ReachResult {
  std::vector<double> dofs;  ///< [D]
  double distance = 0.0;     ///< metres from the joint to the target
};

/// Moves a joint to a target by inverse kinematics: the rotations between the trunk and the joint change, within their
/// limits; the DoFs that move the whole body stay. Levenberg-Marquardt on the distance and on the change of the pose.
/// @param dofs [D] the initial pose  @param joint index  @param target world metres
/// @throws UsageError for another number of DoFs, a joint that does not exist, or numbers that are not finite
ReachResult reach(const Character& character, const std::vector<double>& dofs, int joint, const Eigen::Vector3d& target,
                  const ReachOptions& options = {});

}  // namespace doppel
