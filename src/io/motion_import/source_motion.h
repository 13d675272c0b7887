#pragma once

#include <optional>
#include <string>
#include <vector>

#include "doppel/character/joint_tracks.h"

namespace doppel {

/// A motion of another body, as a reader of one format returns it.
struct SourceMotion {
  JointTracks tracks;  ///< metres, y up
  /// Metres per radian of rotation error when it is retargeted. Rotations that were only guessed from points weigh
  /// less.
  double rotation_weight = 0.1;
  std::vector<std::string> notes;     ///< what was chosen or filled in, one sentence each
  std::vector<std::string> warnings;  ///< what may be wrong, one sentence each
};

/// What a reader needs to know that a file may not say.
struct MotionSourceOptions {
  std::string animation;                  ///< of a rigged file; empty: the only one
  std::string person;                     ///< of a file of points; empty: the only one, or the first
  std::optional<char> up;                 ///< 'x', 'y' or 'z'; default: as each reader says
  std::optional<double> metres_per_unit;  ///< default: as the file says
  double frames_per_second = 0.0;         ///< of the source, where the file states none; 0: unknown
};

}  // namespace doppel
