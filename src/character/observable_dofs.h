#pragma once

#include <vector>

#include "doppel/character/skeleton.h"

namespace doppel {

/// The largest motion of a joint per unit of a DoF: radians or metres; 0 when the DoF moves no joint.
double dof_reach(const Skeleton& skeleton, const Dof& dof);

/// The joint angles (theta of 4.1 and 5.5) and the rotations of the root: DoFs that turn a joint and stretch nothing.
std::vector<int> joint_angles(const Skeleton& skeleton);

/// The DoFs that a fit to landmarks can find: rotations of a landmark's joint or of a joint above it, and translations
/// of the root. DoFs that stretch the body belong to its shape and are left out.
std::vector<int> observable_dofs(const Skeleton& skeleton, const std::vector<Marker>& landmarks);

/// Those of `observable_dofs` that move a landmark by more than a centimetre per radian (for translations: per metre),
/// in the rest pose or with every joint bent by 0.3 rad. The others twist a limb about its own axis, or turn a hand
/// about its only landmark, so landmarks say nothing about them.
/// @param rest [D] the rest pose
std::vector<int> determined_dofs(const Skeleton& skeleton, const std::vector<Marker>& landmarks,
                                 const std::vector<double>& rest);

}  // namespace doppel
