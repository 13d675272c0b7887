#pragma once

#include <vector>

#include "doppel/character/skeleton.h"

namespace doppel {

/// A DoF that moves a joint in inverse kinematics.
struct ReachDof {
  int dof = 0;
  double radians = 1.0;  ///< angle of one unit of the DoF
};

/// The DoFs that bring `joint` to a target: those that turn joints between the trunk and `joint`, and nothing else. The
/// trunk ends at the first joint with several children; in a skeleton without one, the root is the trunk.
std::vector<ReachDof> reach_dofs(const Skeleton& skeleton, int joint);

}  // namespace doppel
