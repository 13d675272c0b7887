#include "doppel/view/reach_dofs.h"

#include <algorithm>
#include <cmath>

namespace doppel {
namespace {

/// Whether a joint is on the way from the root to `descendant`, ends included.
bool carries(const Skeleton& skeleton, int joint, int descendant) {
  while (descendant > joint) descendant = skeleton.joints[descendant].parent;
  return descendant == joint;
}

/// For each joint: whether it belongs to the trunk, so that it moves the whole body.
std::vector<bool> trunk(const Skeleton& skeleton) {
  std::vector<bool> result(skeleton.num_joints(), false), root_alone = result;
  root_alone.front() = true;
  for (int joint = 0;;) {
    result[joint] = true;
    int child = -1, children = 0;
    for (int j = 0; j < skeleton.num_joints(); ++j)
      if (skeleton.joints[j].parent == joint) child = j, ++children;
    if (children > 1) return result;
    if (children == 0) return root_alone;
    joint = child;
  }
}

}  // namespace

std::vector<ReachDof> reach_dofs(const Skeleton& skeleton, int joint) {
  const std::vector<bool> whole = trunk(skeleton);
  std::vector<ReachDof> found;
  for (std::size_t d = 0; d < skeleton.dofs.size(); ++d) {
    const auto& drives = skeleton.dofs[d].joints;
    const bool usable = std::all_of(drives.begin(), drives.end(), [&](const Dof::Drive& drive) {
      return skeleton.joints[drive.joint].type == Joint::Type::revolute && !whole[drive.joint];
    });
    const bool useful = std::any_of(drives.begin(), drives.end(), [&](const Dof::Drive& drive) {
      return drive.joint != joint && carries(skeleton, drive.joint, joint);
    });
    if (usable && useful) found.push_back({static_cast<int>(d), std::abs(drives.front().weight)});
  }
  return found;
}

}  // namespace doppel
