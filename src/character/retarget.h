#pragma once

#include <string>
#include <vector>

#include "doppel/character/joint_map.h"
#include "doppel/character/joint_tracks.h"

namespace doppel {

struct RetargetOptions {
  double frames_per_second = 25.0;  ///< of the result: the rate the actor was trained at
  std::vector<double> rest_dofs;    ///< [D] the target's rest pose; empty: all DoFs 0
  double end_weight = 3.0;          ///< of hands, feet and head against the joints between, in the sum of squares
  double rotation_weight = 0.1;     ///< metres that a radian of wrong rotation counts as
  int iterations = 30;              ///< of Gauss-Newton for one frame, at most
};

struct RetargetResult {
  /// One mapped joint and how near it comes to where it should be.
  struct Track {
    std::string target, source;
    int joint = 0;                                       ///< of the target skeleton
    bool end = false;                                    ///< nothing mapped hangs on it: a hand, a foot, the head
    double mean_distance = 0.0, largest_distance = 0.0;  ///< metres, over all frames
  };
  Motion motion;
  double scale = 1.0;                               ///< metres of the target per metre of the source
  std::vector<Track> tracks;                        ///< [P] parents first
  std::vector<std::vector<Eigen::Vector3d>> goals;  ///< [F][P] the scaled source, world metres
};

/// Makes `skeleton` do what the source does: for each frame of the (resampled) source, damped Gauss-Newton finds the
/// DoFs that bring the mapped joints nearest to the *scaled source*, beginning with the frame before. DoFs stay within
/// their limits.
///
/// The scaled source, g, of a pair (t, s): let p be the nearest mapped joint above t, and b the target's rest bone from
/// p to t, turned as the source's p has turned since its rest pose.
///   g = scale * position(s) + lift   for the root of the map
///   g = g_p + swing(b)               else
/// `swing` is the smallest rotation that takes the source's rest bone from p to t, turned likewise, to where it points
/// now. So bones point where the source's point and have the target's lengths; those that leave one joint together (the
/// hips from the root) keep the angles of the target's own body. `lift`, vertical in the rest pose and turned with the
/// root, makes up for roots at different places of the body: by how much the target's root stands higher above the
/// lowest mapped joint than the source's, scaled.
///
/// What bones leave open (twist, where the head looks) follows the source's rotations relative to its rest pose; where
/// the rest poses differ (arms out or down), by the smallest rotation that lays the target's rest bone along the
/// source's.
///
/// @throws FileError / UsageError for a joint of the map that is not there (with the nearest one), a map without one
/// root
///   or with two, a scale that cannot be found
RetargetResult retarget(const Skeleton& skeleton, const JointTracks& source, const JointMap& map,
                        const RetargetOptions& options = {});

}  // namespace doppel
