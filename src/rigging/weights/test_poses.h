#pragma once

#include <string>
#include <vector>

#include "doppel/character/skeleton.h"

namespace doppel {

/// An extreme pose in which a rig is examined.
struct TestPose {
  std::string name;          ///< in words, for images and reports
  std::vector<double> dofs;  ///< [D]
};

/// The five test poses of the skeleton of make_body_skeleton: arms raised overhead, elbows bent until the hands are at
/// the shoulders, deep squat, high kick, twist with turned head. They lie within the limits of its DoFs. A DoF that a
/// pose does not name keeps its value in the rest pose.
/// @param rest_dofs [D]
/// @throws Error when the skeleton has no DoF of a name that a pose uses
std::vector<TestPose> test_poses(const Skeleton& skeleton, const std::vector<double>& rest_dofs);

}  // namespace doppel
