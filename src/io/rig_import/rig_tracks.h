#pragma once

#include <optional>
#include <string>
#include <vector>

#include "doppel/character/joint_tracks.h"
#include "doppel/io/scene/scene.h"

namespace doppel {

struct RigTracksOptions {
  std::string animation;                  ///< its name in the file; empty: the only one
  std::optional<double> metres_per_unit;  ///< default: as the file says, else guessed by the height
  std::optional<char> up;                 ///< 'x', 'y' or 'z'; default: as the file says, else y
  double frames_per_second = 0.0;         ///< 0: a multiple of the rate of the keys, at least 24, or 30 without a rate
};

struct RigTracks {
  JointTracks tracks;  ///< metres, y up; at rest, each joint has the axes of the world
  std::string animation;
  std::vector<std::string> warnings;
};

/// The joints of a rigged figure during one animation of its file, for retargeting. The rest pose is the bind pose of
/// the skin. Without a skin (a file that holds an animation alone) every node is a joint, and the rest pose is that of
/// the nodes.
/// @throws UsageError when the scene has no animation, several and none is named, or not the named one; Error as
///   plan_rig, and when frames times joints are more than 20 million
RigTracks rig_tracks(const Scene& scene, const RigTracksOptions& options = {});

}  // namespace doppel
