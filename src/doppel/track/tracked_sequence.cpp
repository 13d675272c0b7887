#include "doppel/track/tracked_sequence.h"

#include <algorithm>

#include "doppel/character/bvh.h"
#include "doppel/character/landmarks.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/track/pose_sequence.h"

namespace doppel {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

namespace {

ordered_json frame_json(long frame, const TrackedFrame& found) {
  return {{"frame", frame},
          {"state", to_string(found.state)},
          {"keypoints", found.keypoints},
          {"agreeing", found.agreeing},
          {"keypoint_error_px", found.keypoint_error},
          {"steps", found.iterations},
          {"stopped_by", to_string(found.reason)},
          {"costs", costs_json(found.terms)}};
}

/// The capture with the tracked motions in the place of its own.
Capture tracked_capture(const Footage& footage, const fs::path& out, const std::vector<TrackedSequence>& tracked) {
  Capture capture = footage.capture();
  for (SequenceEntry& entry : capture.sequences)
    for (const TrackedSequence& sequence : tracked) {
      if (sequence.sequence.name != entry.name) continue;
      const fs::path motion = fs::absolute(out / (entry.name + ".motion")).lexically_normal();
      const fs::path inside = motion.lexically_relative(capture.root);
      entry.motion = inside.empty() || *inside.begin() == ".." ? motion.string() : inside.string();
      entry.first_frame = sequence.sequence.first_frame;
      entry.last_frame = sequence.sequence.last_frame;
    }
  const auto untracked = [](const SequenceEntry& entry) { return entry.motion.empty(); };
  capture.sequences.erase(std::remove_if(capture.sequences.begin(), capture.sequences.end(), untracked),
                          capture.sequences.end());
  return capture;
}

}  // namespace

int TrackedSequence::count(FrameState state) const {
  return static_cast<int>(
      std::count_if(frames.begin(), frames.end(), [&](const TrackedFrame& frame) { return frame.state == state; }));
}

MotionDifference compare_motions(const Skeleton& skeleton, const std::vector<Marker>& landmarks, const Motion& a,
                                 const Motion& b, long first_frame, long last_frame) {
  MotionDifference result;
  double count = 0.0;
  for (long row = first_frame; row <= last_frame; ++row) {
    const auto f = static_cast<std::size_t>(row);
    const auto in_a = landmark_positions(skeleton, landmarks, a.frames[f]);
    const auto in_b = landmark_positions(skeleton, landmarks, b.frames[f]);
    Eigen::Vector3d shift = Eigen::Vector3d::Zero();
    for (std::size_t m = 0; m < landmarks.size(); ++m) shift += (in_a[m] - in_b[m]) / static_cast<double>(in_a.size());
    for (std::size_t m = 0; m < landmarks.size(); ++m) {
      result.mean_mm += 1e3 * (in_a[m] - in_b[m]).norm();
      result.within_150mm += (in_a[m] - in_b[m] - shift).norm() <= 0.15;
      ++count;
    }
  }
  result.mean_mm /= count;
  result.within_150mm /= count;
  return result;
}

void make_motion(TrackedSequence& tracked, const std::optional<RootRotation>& root, double smoothing) {
  std::vector<std::vector<double>> poses;
  std::vector<bool> trusted;
  for (const TrackedFrame& frame : tracked.frames) {
    poses.push_back(frame.dofs);
    trusted.push_back(frame.trusted());
  }
  const FootageSequence& sequence = tracked.sequence;
  if (std::find(trusted.begin(), trusted.end(), true) == trusted.end())
    fail(
        "sequence {}: the person was found in none of its {} frames; check that keypoints, calibration and "
        "landmarks belong together (the mean confidence may be too low, or too few cameras see the person)",
        sequence.name, trusted.size());
  const std::vector<long> cuts = sequence.cuts_from_first();
  bridge_poses(poses, trusted, cuts, root);
  smooth_poses(poses, cuts, root, smoothing);
  tracked.motion.frames.assign(static_cast<std::size_t>(sequence.first_frame), poses.front());
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

ordered_json costs_json(const std::vector<TermCost>& terms) {
  ordered_json costs;
  for (const TermCost& term : terms) costs[term.name] = term.cost;
  return costs;
}

ordered_json summary_of(const TrackedSequence& tracked) {
  ordered_json lost = ordered_json::array();
  double error = 0.0, steps = 0.0;
  for (std::size_t i = 0; i < tracked.frames.size(); ++i) {
    const TrackedFrame& found = tracked.frames[i];
    if (!found.trusted()) lost.push_back(tracked.sequence.first_frame + static_cast<long>(i));
    error += found.keypoint_error;
    steps += found.iterations;
  }
  const auto count = static_cast<double>(tracked.frames.size());
  ordered_json result{{"frames", tracked.frames.size()}, {"lost_frames", lost}};
  for (const FrameState state : {FrameState::tracked, FrameState::initialised, FrameState::recovered})
    result[to_string(state)] = tracked.count(state);
  result["keypoint_error_px"] = error / count;
  result["steps_per_frame"] = steps / count;
  result["frames_per_second"] = tracked.seconds > 0.0 ? count / tracked.seconds : 0.0;
  return result;
}

ordered_json report_of(const Footage& footage, const TrackedSequence& tracked) {
  ordered_json result = summary_of(tracked);
  if (!tracked.sequence.motion.empty()) {
    const Skeleton& skeleton = footage.character().skeleton;
    const Motion given = read_motion(tracked.sequence.motion, skeleton.num_dofs());
    if (given.num_frames() > tracked.sequence.last_frame) {
      const MotionDifference difference = compare_motions(skeleton, footage.landmarks(), tracked.motion, given,
                                                          tracked.sequence.first_frame, tracked.sequence.last_frame);
      result["against_given_motion"] = {{"MPJPE_mm", difference.mean_mm}, {"3DPCK", 100.0 * difference.within_150mm}};
    }
  }
  ordered_json frames = ordered_json::array();
  for (std::size_t i = 0; i < tracked.frames.size(); ++i)
    frames.push_back(frame_json(tracked.sequence.first_frame + static_cast<long>(i), tracked.frames[i]));
  result["per_frame"] = frames;
  return result;
}

void write_results(const Footage& footage, const fs::path& out, const std::vector<TrackedSequence>& tracked,
                   const ordered_json& report) {
  write_capture(out / "capture.yaml", tracked_capture(footage, out, tracked));
  write_atomically(out / "track.json", report.dump(1) + "\n");
}

}  // namespace doppel
