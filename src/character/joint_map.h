#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "doppel/character/skeleton.h"
#include "doppel/core/error.h"

namespace doppel {

/// Which joint of a skeleton plays the part of which joint of another one.
struct JointMap {
  struct Pair {
    std::string target;  ///< a joint of the character, or a bone (`LeftArm` for `LeftArm_ry`, `LeftArm_rx`)
    std::string source;  ///< a joint of the motion's skeleton
    /// Turns the source joint's rest pose, about its world's x, then y, then z axis, before anything is compared:
    /// radians.
    Eigen::Vector3d rest_rotation = Eigen::Vector3d::Zero();
    FileLocation where;  ///< for messages
  };
  /// Where the factor between the two bodies comes from.
  enum class Scale { hip_height, leg_length, number };

  std::vector<Pair> pairs;
  Scale scale = Scale::leg_length;
  double factor = 1.0;  ///< for Scale::number: metres of the target per metre of the source
  bool z_up = false;    ///< the source's world; BVH files mostly have y up
};

/// Reads a map from YAML:
/// @code
///   joints:            # joint or bone of the character: joint of the motion
///     Root: Hips
///     LeftArm: LeftUpperArm
///   scale: leg_length  # or hip_height, or a number
///   up: y              # or z
///   rest_rotation:     # degrees about x, y, z, where the two rest poses differ in twist
///     LeftArm: [0, 0, 45]
/// @endcode
/// @throws FileError with the line
JointMap read_joint_map(const std::filesystem::path& path);

/// Pairs joints by what they are called in skeletons of Captury/Skeletool, Mixamo, CMU, Biovision and Poser files:
/// hips, neck, head, collar, arm, forearm, hand, thigh, shin, foot and toes, whatever prefix (`mixamorig:`) they carry.
/// @param target names of the character's joints
/// @throws UsageError when not even hips and feet are recognised, listing the names on the side that failed
JointMap guess_joint_map(const std::vector<std::string>& target, const std::vector<std::string>& source);

/// The map as YAML text, to be saved and put right by hand.
std::string joint_map_text(const JointMap& map);

}  // namespace doppel
