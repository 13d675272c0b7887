#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "doppel/character/motion.h"
#include "doppel/character/skeleton.h"

namespace doppel {

/// The transforms of the joints of any skeleton, frame by frame: the input of retargeting.
struct JointTracks {
  std::vector<std::string> names;
  std::vector<int> parents;           ///< smaller than the joint's own index, -1 for the root
  std::vector<Eigen::Affine3d> rest;  ///< [S] world from joint in the skeleton's own rest pose, metres
  std::vector<std::vector<Eigen::Affine3d>>
      frames;  ///< [F][S] world from joint, metres; y up unless a joint map says z
  double seconds_per_frame = 0.04;

  int num_joints() const { return static_cast<int>(names.size()); }
  int num_frames() const { return static_cast<int>(frames.size()); }
};

/// The joints of a Skeletool skeleton during a motion.
/// @param rest_dofs the pose that counts as rest, [D]; empty: all DoFs 0
JointTracks joint_tracks(const Skeleton& skeleton, const Motion& motion, double frames_per_second,
                         const std::vector<double>& rest_dofs = {});

/// The tracks at another frame rate. Between two frames, each joint's position relative to its parent is interpolated
/// linearly and its rotation spherically, so that bones keep their lengths. The first and the last instant stay.
/// @throws UsageError unless the rate is in (0, 1000]
JointTracks resample(const JointTracks& tracks, double frames_per_second);

}  // namespace doppel
