#pragma once

#include <string>
#include <vector>

#include "doppel/character/joint_map.h"
#include "doppel/character/joint_tracks.h"

namespace doppel {

struct RetargetOptions {
  double frames_per_second = 25.0;  ///< of the result: the rate the actor was trained at
  std::vector<double> rest_dofs;    ///< [D] the target's rest pose; empty: all DoFs 0
  double end_weight = 3.0;          ///< of hands, feet and head relative to other joints, in the sum of squares
  double rotation_weight = 0.1;     ///< metres per radian of rotation error
  int iterations = 30;              ///< largest number of Gauss-Newton steps per frame
};

struct RetargetResult {
  /// One mapped joint and its distance from its goals.
  struct Track {
    std::string target, source;
    int joint = 0;                                       ///< of the target skeleton
    bool end = false;                                    ///< no mapped joint lies below it: a hand, a foot, the head
    double mean_distance = 0.0, largest_distance = 0.0;  ///< metres, over all frames
  };
  Motion motion;
  bool rest_from_motion = false;  ///< the source's rest pose is no pose of a body, so one was found from the motion
  double scale = 1.0;             ///< metres of the target per metre of the source
  std::vector<Track> tracks;      ///< [P] parents first
  std::vector<std::vector<Eigen::Vector3d>> goals;  ///< [F][P] the scaled source, world metres
};

/// Transfers the motion of the source to `skeleton`. For each frame of the resampled source, damped Gauss-Newton finds
/// the DoFs that bring the mapped joints nearest to the *scaled source*. It starts from the previous frame. DoFs stay
/// within their limits.
///
/// The scaled source, g, of a pair (t, s): let p be the nearest mapped joint above t, and b the target's rest bone from
/// p to t, rotated as the source's p has rotated since its rest pose.
///   g = scale * position(s) + lift   for the root of the map
///   g = g_p + swing(b)               else
/// `swing` is the smallest rotation from the source's rest bone from p to t, rotated in the same way, to its present
/// direction. Bones thus have the directions of the source and the lengths of the target. Bones that start at the same
/// joint (the hips from the root) keep the angles of the target's body. `lift` compensates for roots at different
/// positions in the body: it is the height of the target's root above its lowest mapped joint minus the scaled height
/// of the source's root. It is vertical in the rest pose, which may stand along any axis, and rotates with the root.
///
/// Bone directions do not determine the twist and the direction of the head. These follow the source's rotations
/// relative to its rest pose. Where the rest poses differ (arms out or down), the smallest rotation that aligns the
/// target's rest bone with the source's corrects them. A source whose rest pose is no pose of a body (all bones along
/// one axis) gets one from its motion (rest_from_motion), and rotations then count as 1 cm per radian at most.
///
/// @throws FileError / UsageError for an unknown joint in the map (the message names the nearest joint), a map without
///   a root or with two, a scale that cannot be determined
RetargetResult retarget(const Skeleton& skeleton, const JointTracks& source, const JointMap& map,
                        const RetargetOptions& options = {});

/// Where the body of a motion points from its feet to its head, in the axes of its own world.
struct SourceStance {
  Eigen::Vector3d rest = Eigen::Vector3d::Zero();    ///< in the rest pose, length 1; 0 where that is no pose of a body
  Eigen::Vector3d motion = Eigen::Vector3d::Zero();  ///< the mean over the frames of the directions of length 1
};

/// The stance by the pairs of a map: where the heights of the character's joints at rest increase in the source.
/// `map.z_up` is not used. @throws FileError as retarget
SourceStance source_stance(const Skeleton& skeleton, const std::vector<double>& rest_dofs, const JointTracks& source,
                           const JointMap& map);

}  // namespace doppel
