#include "doppel/track/tracked_sequence.h"

#include <fmt/format.h>

#include <algorithm>

#include "doppel/character/bvh.h"
#include "doppel/character/landmarks.h"
#include "doppel/core/error.h"
#include "doppel/track/pose_sequence.h"

namespace doppel {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

namespace {

ordered_json frame_json(long frame, const TrackedFrame& found) {
  ordered_json terms;
  for (const TermCost& term : found.terms) terms[term.name] = term.cost;
  return {{"frame", frame},
          {"state", to_string(found.state)},
          {"keypoints", found.keypoints},
          {"agreeing", found.agreeing},
          {"keypoint_error_px", found.keypoint_error},
          {"steps", found.iterations},
          {"stopped_by", to_string(found.reason)},
          {"costs", terms}};
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

std::vector<int> chosen_sequences(const Footage& footage, const std::vector<std::string>& names) {
  std::vector<int> chosen;
  std::string known;
  for (std::size_t s = 0; s < footage.sequences().size(); ++s) {
    const std::string& name = footage.sequences()[s].name;
    known += (s ? ", " : "") + name;
    if (names.empty() || std::find(names.begin(), names.end(), name) != names.end())
      chosen.push_back(static_cast<int>(s));
  }
  if (!names.empty() && chosen.size() != names.size())
    fail<UsageError>("not all of the sequences {} are in the capture; it has {}", fmt::join(names, ", "), known);
  return chosen;
}

std::vector<long> spread_frames(const FootageSequence& sequence, int count) {
  std::vector<long> frames;
  for (int i = 0; i < count; ++i) {
    const long frame = sequence.first_frame + (2 * i + 1) * sequence.num_frames() / (2 * count);
    if (frames.empty() || frame != frames.back()) frames.push_back(frame);
  }
  return frames;
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
  std::vector<long> cuts;
  for (const long cut : sequence.cuts) cuts.push_back(cut - sequence.first_frame);
  bridge_poses(poses, trusted, cuts, root);
  smooth_poses(poses, cuts, root, smoothing);
  tracked.motion.frames.assign(static_cast<std::size_t>(sequence.first_frame), poses.front());
  tracked.motion.frames.insert(tracked.motion.frames.end(), poses.begin(), poses.end());
  for (int row = 0; row < tracked.motion.num_frames(); ++row) tracked.motion.ids.push_back(row);
}

void write_poses(const Footage& footage, const fs::path& out, const TrackedSequence& tracked) {
  const fs::path stem = out / tracked.sequence.name;
  const Character& character = footage.character();
  write_motion(stem.string() + ".motion", tracked.motion, true);
  write_bvh(stem.string() + ".bvh",
            bvh_from_motion(character.skeleton, tracked.motion, footage.capture().fps, character.rest_dofs));
}

ordered_json report_of(const Footage& footage, const TrackedSequence& tracked) {
  ordered_json frames = ordered_json::array(), lost = ordered_json::array();
  double error = 0.0, steps = 0.0;
  for (std::size_t i = 0; i < tracked.frames.size(); ++i) {
    const long frame = tracked.sequence.first_frame + static_cast<long>(i);
    const TrackedFrame& found = tracked.frames[i];
    frames.push_back(frame_json(frame, found));
    if (!found.trusted()) lost.push_back(frame);
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
  if (!tracked.sequence.motion.empty()) {
    const Skeleton& skeleton = footage.character().skeleton;
    const Motion given = read_motion(tracked.sequence.motion, skeleton.num_dofs());
    if (given.num_frames() > tracked.sequence.last_frame) {
      const MotionDifference difference = compare_motions(skeleton, footage.landmarks(), tracked.motion, given,
                                                          tracked.sequence.first_frame, tracked.sequence.last_frame);
      result["against_given_motion"] = {{"MPJPE_mm", difference.mean_mm}, {"3DPCK", 100.0 * difference.within_150mm}};
    }
  }
  result["per_frame"] = frames;
  return result;
}

void write_tracked_capture(const Footage& footage, const fs::path& out, const std::vector<TrackedSequence>& tracked) {
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
  write_capture(out / "capture.yaml", capture);
}

void check_out_folder(const Footage& footage, const fs::path& out) {
  if (out.empty()) fail<UsageError>("no folder to write into was given");
  const fs::path& file = footage.capture().file;
  if (!file.empty() && fs::weakly_canonical(out / "capture.yaml") == fs::weakly_canonical(file))
    fail<UsageError>("{} holds the capture itself; write into a folder of its own with --out", out.string());
}

}  // namespace doppel
