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
/// The scaled source, g, of a pair (t, s): let p be the nearest mapped joint above t and L_t the distance between t and
/// p in the target's rest pose.
///   g = scale * position(s)                                      for the root of the map
///   g = g_p + L_t * direction from position(s_p) to position(s)  else
/// so bones point where the source's point and have the target's lengths. What bones leave open (twist, where the head
/// looks) follows the source's rotations relative to its rest pose; where the rest poses differ (arms out or down), by
/// the smallest rotation that lays the target's rest bone along the source's.
///
/// @throws FileError / UsageError for a joint of the map that is not there (with the nearest one), a map without one
/// root
///   or with two, a scale that cannot be found
RetargetResult retarget(const Skeleton& skeleton, const JointTracks& source, const JointMap& map,
                        const RetargetOptions& options = {});

}  // namespace doppel
