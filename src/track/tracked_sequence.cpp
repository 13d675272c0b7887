#include "doppel/track/tracked_sequence.h"

#include <algorithm>

#include "doppel/character/bvh.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/core/process.h"
#include "doppel/track/fit/pose_sequence.h"

namespace doppel {

namespace fs = std::filesystem;

int TrackedSequence::count(FrameState state) const {
  return static_cast<int>(
      std::count_if(frames.begin(), frames.end(), [&](const TrackedFrame& frame) { return frame.state == state; }));
}

void make_motion(TrackedSequence& tracked, const std::optional<RootRotation>& root, double smoothing, int degree) {
  std::vector<std::vector<double>> poses;
  std::vector<bool> found;
  for (const TrackedFrame& frame : tracked.frames) {
    poses.push_back(frame.dofs);
    found.push_back(frame.found());
  }
  const FootageSequence& sequence = tracked.sequence;
  if (std::find(found.begin(), found.end(), true) == found.end())
    fail(
        "sequence {}: the person was found in none of its {} frames; check that keypoints, calibration and "
        "landmarks belong together (the mean confidence may be too low, or too few cameras see the person)",
        sequence.name, found.size());
  const std::vector<long> cuts = sequence.cuts_from_first();
  bridge_poses(poses, found, cuts, root);
  smooth_poses(poses, cuts, root, smoothing, degree);
  tracked.motion.frames.assign(sequence.first_frame, poses.front());
  tracked.motion.frames.insert(tracked.motion.frames.end(), poses.begin(), poses.end());
  for (int row = 0; row < tracked.motion.num_frames(); ++row) tracked.motion.ids.push_back(row);
}

void write_poses(const Character& character, double frames_per_second, const fs::path& out,
                 const TrackedSequence& tracked) {
  const fs::path stem = out / tracked.sequence.name;
  write_motion(stem.string() + ".motion", tracked.motion, true);
  write_bvh(stem.string() + ".bvh",
            bvh_from_motion(character.skeleton, tracked.motion, frames_per_second, character.rest_dofs));
}

void run_second_pass(TrackedSequence& tracked, const std::function<void()>& work) {
  if (!tracked.stopped.empty()) return;
  try {
    work();
  } catch (const Error& e) {
    if (!stop_requested() && !dynamic_cast<const FileError*>(&e)) throw;
    tracked.stopped = e.what();
    log::warn("sequence {}: the poses are complete, their surfaces are not: {}", tracked.sequence.name, e.what());
  }
}

}  // namespace doppel
