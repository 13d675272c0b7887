#include "doppel/character/joint_tracks.h"

#include <algorithm>
#include <cmath>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel {
namespace {

using Transforms = std::vector<Eigen::Affine3d>;

/// Converts world-from-joint to parent-from-joint transforms.
Transforms relative_to_parents(const JointTracks& tracks, const Transforms& world) {
  Transforms local(world.size());
  for (std::size_t j = 0; j < world.size(); ++j) {
    const int parent = tracks.parents[j];
    local[j] = parent < 0 ? world[j] : world[parent].inverse(Eigen::Isometry) * world[j];
  }
  return local;
}

Eigen::Affine3d between(const Eigen::Affine3d& a, const Eigen::Affine3d& b, double share) {
  const Eigen::Quaterniond from(a.linear()), to(b.linear());
  Eigen::Affine3d mixed = Eigen::Affine3d::Identity();
  mixed.linear() = from.slerp(share, to).toRotationMatrix();
  mixed.translation() = (1.0 - share) * a.translation() + share * b.translation();
  return mixed;
}

Transforms mix(const JointTracks& tracks, const Transforms& before, const Transforms& after, double share) {
  const Transforms a = relative_to_parents(tracks, before), b = relative_to_parents(tracks, after);
  Transforms world(a.size());
  for (std::size_t j = 0; j < a.size(); ++j) {
    const int parent = tracks.parents[j];
    const Eigen::Affine3d local = between(a[j], b[j], share);
    world[j] = parent < 0 ? local : world[parent] * local;
  }
  return world;
}

}  // namespace

JointTracks joint_tracks(const Skeleton& skeleton, const Motion& motion, double frames_per_second,
                         const std::vector<double>& rest_dofs) {
  JointTracks tracks;
  for (const Joint& joint : skeleton.joints) {
    tracks.names.push_back(joint.name);
    tracks.parents.push_back(joint.parent);
  }
  tracks.seconds_per_frame = 1.0 / frames_per_second;
  tracks.rest = skeleton.pose(rest_dofs.empty() ? std::vector<double>(skeleton.dofs.size(), 0.0) : rest_dofs);
  for (const std::vector<double>& dofs : motion.frames) tracks.frames.push_back(skeleton.pose(dofs));
  return tracks;
}

JointTracks resample(const JointTracks& tracks, double frames_per_second) {
  if (!(frames_per_second > 0.0) || frames_per_second > 1000.0)
    fail<UsageError>("cannot resample a motion to {} frames a second; it must be above 0 and at most 1000",
                     frames_per_second);
  JointTracks result = tracks;
  result.seconds_per_frame = 1.0 / frames_per_second;
  const double step = result.seconds_per_frame / tracks.seconds_per_frame;  // in frames of the input
  if (tracks.num_frames() < 2 || std::abs(step - 1.0) < 1e-6) return result;
  result.frames.clear();
  const double last = tracks.num_frames() - 1;
  constexpr double kMaxFrames = 1e6;
  if (last / step > kMaxFrames)
    fail<UsageError>("resampling {} frames of {} s to {} a second gives more than a million; is the frame time right?",
                     tracks.num_frames(), tracks.seconds_per_frame, frames_per_second);
  for (long i = 0; static_cast<double>(i) * step <= last + 1e-6; ++i) {
    const double at = std::min(static_cast<double>(i) * step, last);
    const auto before = std::min(as_size(at), tracks.frames.size() - 2);
    result.frames.push_back(
        mix(tracks, tracks.frames[before], tracks.frames[before + 1], at - static_cast<double>(before)));
  }
  return result;
}

}  // namespace doppel
