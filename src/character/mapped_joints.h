#pragma once

#include <Eigen/Core>
#include <vector>

#include "doppel/character/joint_map.h"
#include "doppel/character/joint_tracks.h"

namespace doppel {

inline constexpr double kNoBoneLength = 1e-4;  ///< metres; a shorter bone has no direction

/// One pair of a joint map, resolved. The pairs form a tree, the nearest pair above each in the character.
struct MappedJoint {
  int target = 0;                                           ///< joint of the character
  int source = 0;                                           ///< joint of the motion
  int parent = -1;                                          ///< pair, -1 for the root
  bool end = true;                                          ///< no pair lies below it
  Eigen::Matrix3d rest_turn = Eigen::Matrix3d::Identity();  ///< rotation of the source's rest pose by the map
};

/// The pairs of a map, parents first: at least two, and one root. @throws FileError as retarget
std::vector<MappedJoint> mapped_joints(const Skeleton& skeleton, const JointTracks& source, const JointMap& map);

}  // namespace doppel
