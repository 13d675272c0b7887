#pragma once

#include <Eigen/Geometry>
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
  std::vector<std::string> notes;  ///< what was chosen or filled in, one sentence each
};

/// What a reader needs to know that a file may not say.
struct SourceOptions {
  std::string animation;                  ///< of a rigged file; empty: the only one
  std::optional<char> up;                 ///< 'x', 'y' or 'z'; default: as each reader says
  std::optional<double> metres_per_unit;  ///< default: as the file says
  double frames_per_second = 0.0;         ///< of the source, where the file states none; 0: unknown
};

/// The rotation that takes a vertical axis to y: about x for z and -y, otherwise the smallest one.
Eigen::Matrix3d y_up_from_axis(const Eigen::Vector3d& up);

/// The axis among +-x, +-y, +-z that is nearest to a direction, and the cosine between them.
struct NearestAxis {
  Eigen::Vector3d axis = Eigen::Vector3d::UnitY();
  double cosine = 0.0;  ///< 0 for a direction of no length
};
NearestAxis nearest_axis(const Eigen::Vector3d& direction);
/// "z" or "-y".
std::string axis_name(const Eigen::Vector3d& axis);

}  // namespace doppel
