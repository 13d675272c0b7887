#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "doppel/character/character.h"
#include "doppel/character/retarget.h"
#include "doppel/io/motion_import/source_motion.h"

namespace doppel {

struct MotionFileOptions {
  std::filesystem::path map;              ///< joint map (read_joint_map); empty: guessed
  std::filesystem::path source_skeleton;  ///< of a `.motion` of another skeleton; empty: the character's own
  MotionSourceOptions source;
  double frames_per_second = 0.0;  ///< of the result; 0: that of the file
};

/// A motion of any format as a motion of one character.
struct MotionFromFile {
  Motion motion;
  double frames_per_second = 0.0;
  std::optional<JointMap> guessed_map;        ///< where the motion is another body's and no map was given
  std::optional<RetargetResult> retargeting;  ///< where the motion is another body's; its motion is moved to `motion`
  std::vector<std::string> notes;             ///< what was chosen or filled in, one sentence each
  std::vector<std::string> warnings;          ///< what may be wrong, one sentence each
};

/// Whether a file with this extension is the motion of another body. `.motion` is not.
bool is_foreign_motion(const std::filesystem::path& path);

/// Reads a motion for a character. The extension decides:
///
/// | extension | read by | joint map without `map` |
/// |---|---|---|
/// | `.motion` | read_motion; retargeted with `source_skeleton` | guess_joint_map |
/// | `.bvh` | read_bvh | guess_joint_map |
/// | `.glb`, `.gltf`, `.vrm`, `.fbx`, `.dae` | rig_tracks | landmark_joint_map |
/// | `.npz` | read_smpl_motion | landmark_joint_map |
/// | `.c3d`, `.trc` | read_marker_motion | landmark_joint_map |
///
/// All but a `.motion` of the character itself are retargeted. Without `frames_per_second`, the result has the rate of
/// the file, otherwise it is resampled. A `.motion` states no rate: it has that of the options for the source, else the
/// imported_rate, else that of the result, else 25. The vertical of `.bvh` and `.motion` is that of the options, else
/// of the map, else vertical_of.
/// @throws UsageError for another extension, a map of a motion that needs none, `up: z` in the map of a format whose
///   reader finds the vertical, a person of a format without people; Error as the readers and retarget
MotionFromFile read_motion_file(const std::filesystem::path& path, const Character& character,
                                const MotionFileOptions& options = {});

}  // namespace doppel
