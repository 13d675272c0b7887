#include "doppel/track/tracked_sequence.h"

#include <torch/torch.h>

#include <algorithm>
#include <numeric>

#include "doppel/character/bvh.h"
#include "doppel/character/landmarks.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/eval/pose_metrics.h"
#include "doppel/track/pose_sequence.h"
#include "doppel/track/track_curves.h"
#include "doppel/track/truth.h"

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

/// [1,M,3]
torch::Tensor tensor_of(const std::vector<Eigen::Vector3d>& points) {
  torch::Tensor result = torch::empty({1, static_cast<std::int64_t>(points.size()), 3}, torch::kFloat64);
  for (std::size_t i = 0; i < points.size(); ++i)
    Eigen::Map<Eigen::Vector3d>(result.data_ptr<double>() + 3 * i) = points[i];
  return result;
}

double mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

/// Gives each frame its number.
void add_curve(ordered_json& frames, const char* key, const std::vector<double>& values) {
  for (std::size_t i = 0; i < values.size(); ++i) frames[i][key] = values[i];
}

void add_motion_difference(const Footage& footage, const TrackedSequence& tracked, ordered_json& result,
                           ordered_json& frames) {
  const FootageSequence& sequence = tracked.sequence;
  if (sequence.motion.empty()) return;
  const Skeleton& skeleton = footage.character().skeleton;
  const Motion given = read_motion(sequence.motion, skeleton.num_dofs());
  if (given.num_frames() <= sequence.last_frame) return;
  const MotionDifference difference =
      compare_motions(skeleton, footage.landmarks(), tracked.motion, given, sequence.first_frame, sequence.last_frame);
  result["against_given_motion"] = {{"MPJPE_mm", difference.mean_mm},
                                    {"MPJPE_aligned_mm", difference.aligned_mm},
                                    {"3DPCK", 100.0 * difference.within_150mm}};
  add_curve(frames, "joints_mm", difference.frame_mm);
  add_curve(frames, "aligned_joints_mm", difference.frame_aligned_mm);
}

void add_surface_errors(const Footage& footage, const TrackedSequence& tracked, ordered_json& result,
                        ordered_json& frames) {
  const std::optional<SurfaceErrors> errors = surface_errors(footage, tracked);
  if (!errors) return;
  result["against_true_surface"]["vertex_error_pose_mm"] = mean(errors->skinned);
  add_curve(frames, "pose_vertices_mm", errors->skinned);
  if (errors->tracked.empty()) return;
  result["against_true_surface"]["vertex_error_mm"] = mean(errors->tracked);
  add_curve(frames, "vertices_mm", errors->tracked);
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
    double distance = 0.0;
    for (std::size_t m = 0; m < landmarks.size(); ++m) {
      distance += 1e3 * (in_a[m] - in_b[m]).norm();
      result.within_150mm += (in_a[m] - in_b[m] - shift).norm() <= 0.15;
      ++count;
    }
    const torch::Tensor truth = tensor_of(in_b), aligned = align_similarity(tensor_of(in_a), truth);
    result.frame_mm.push_back(distance / static_cast<double>(landmarks.size()));
    result.frame_aligned_mm.push_back(1e3 * (aligned - truth).norm(2, -1).mean().item<double>());
  }
  result.mean_mm = mean(result.frame_mm);
  result.aligned_mm = mean(result.frame_aligned_mm);
  result.within_150mm /= count;
  return result;
}

void make_motion(TrackedSequence& tracked, const std::optional<RootRotation>& root, double smoothing, int degree) {
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
  smooth_poses(poses, cuts, root, smoothing, degree);
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
  ordered_json frames = ordered_json::array();
  for (std::size_t i = 0; i < tracked.frames.size(); ++i)
    frames.push_back(frame_json(tracked.sequence.first_frame + static_cast<long>(i), tracked.frames[i]));
  add_motion_difference(footage, tracked, result, frames);
  add_surface_errors(footage, tracked, result, frames);
  result["per_frame"] = frames;
  return result;
}

void write_results(const Footage& footage, const fs::path& out, const std::vector<TrackedSequence>& tracked,
                   const ordered_json& report) {
  write_capture(out / "capture.yaml", tracked_capture(footage, out, tracked));
  write_atomically(out / "track.json", report.dump(1) + "\n");
  write_atomically(out / "track.html", track_curves(report));
}

}  // namespace doppel
