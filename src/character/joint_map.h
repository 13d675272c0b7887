#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "doppel/character/skeleton.h"
#include "doppel/core/error.h"

namespace doppel {

/// Pairs the joints of one skeleton with the joints of another.
struct JointMap {
  struct Pair {
    std::string target;  ///< a joint of the character, or a bone (`LeftArm` for `LeftArm_ry`, `LeftArm_rx`)
    std::string source;  ///< a joint of the motion's skeleton
    /// Rotation of the source joint's rest pose about the x, then y, then z axis of its world, applied before any
    /// comparison: radians.
    Eigen::Vector3d rest_rotation = Eigen::Vector3d::Zero();
    FileLocation where;  ///< for messages
  };
  /// The source of the scale factor between the two bodies.
  enum class Scale { hip_height, leg_length, number };

  std::vector<Pair> pairs;
  Scale scale = Scale::leg_length;
  double factor = 1.0;       ///< for Scale::number: metres of the target per metre of the source
  std::optional<bool> z_up;  ///< the vertical axis of the source's world, z or y; nothing where the map states none
};

/// Reads a map from YAML:
/// @code
///   joints:            # joint or bone of the character: joint of the motion
///     Root: Hips
///     LeftArm: LeftUpperArm
///   scale: leg_length  # or hip_height, or a number
///   up: y              # or z; without it as the motion shows, else y
///   rest_rotation:     # degrees about x, y, z, where the two rest poses differ in twist
///     LeftArm: [0, 0, 45]
/// @endcode
/// @throws FileError with the line
JointMap read_joint_map(const std::filesystem::path& path);

/// Pairs joints by the names they have in Captury/Skeletool, Mixamo, CMU, Biovision and Poser files: hips, neck, head,
/// collar, arm, forearm, hand, thigh, shin, foot and toes, with any prefix (`mixamorig:`).
/// @param target names of the character's joints
/// @throws UsageError when hips or feet are not recognised, listing the names of the skeleton that failed
JointMap guess_joint_map(const std::vector<std::string>& target, const std::vector<std::string>& source);

/// The map as YAML text, which can be saved and corrected by hand.
std::string joint_map_text(const JointMap& map);

}  // namespace doppel
