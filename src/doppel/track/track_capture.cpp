#include "doppel/track/track_capture.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <opencv2/imgcodecs.hpp>

#include "doppel/character/bvh.h"
#include "doppel/character/landmarks.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/core/npy.h"
#include "doppel/core/process.h"
#include "doppel/core/progress.h"
#include "doppel/track/outline.h"
#include "doppel/track/pose_sequence.h"
#include "doppel/track/track_sheet.h"

namespace doppel {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

namespace {

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

/// So many frames, spread over a sequence.
std::vector<long> spread_frames(const FootageSequence& sequence, int count) {
  std::vector<long> frames;
  for (int i = 0; i < count; ++i) {
    const long frame = sequence.first_frame + (2 * i + 1) * sequence.num_frames() / (2 * count);
    if (frames.empty() || frame != frames.back()) frames.push_back(frame);
  }
  return frames;
}

/// One sequence, from its frames to its files.
class SequenceRun {
 public:
  /// @param character with the template to fit
  SequenceRun(const Footage& footage, const Character& character, const TrackOptions& options, int sequence)
      : footage_(footage),
        options_(options),
        index_(sequence),
        tracker_(character, footage.landmarks(),
                 chosen_dofs(options.config, footage.character().skeleton, footage.landmarks()), footage.cameras(),
                 options.config.fit) {
    result_.sequence = footage.sequences()[static_cast<std::size_t>(sequence)];
    if (options.limit_frames > 0)
      result_.sequence.last_frame =
          std::min(result_.sequence.last_frame, result_.sequence.first_frame + options.limit_frames - 1);
  }

  TrackedSequence run(Progress& progress) {
    const FootageSequence& sequence = result_.sequence;
    const auto reader = footage_.read(index_);
    const std::vector<long> shown = spread_frames(sequence, options_.sheet_frames);
    TrackSheet sheet(footage_.cameras(), tracker_.model(), options_.config.fit.outline_pixels);
    for (long frame = sequence.first_frame; frame <= sequence.last_frame; ++frame) {
      if (stop_requested()) fail("stopped at frame {} of sequence {}; nothing of it was kept", frame, sequence.name);
      const bool show = std::find(shown.begin(), shown.end(), frame) != shown.end();
      const FootageFrame seen = reader->read(frame, show);
      track(frame, seen.evidence);
      if (show) sheet.add(frame, seen, result_.frames.back());
      progress.advance(1, fmt::format("{} {}", sequence.name, to_string(result_.frames.back().state)));
    }
    make_motion();
    if (!sheet.empty()) cv::imwrite((options_.out / (sequence.name + ".jpg")).string(), sheet.image());
    return std::move(result_);
  }

 private:
  void track(long frame, const FrameEvidence& evidence) {
    const std::vector<long>& cuts = result_.sequence.cuts;
    if (std::find(cuts.begin(), cuts.end(), frame) != cuts.end()) tracker_.cut();
    const auto start = std::chrono::steady_clock::now();
    result_.frames.push_back(tracker_.track(evidence));
    result_.seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  }

  void make_motion() {
    std::vector<std::vector<double>> poses;
    std::vector<bool> trusted;
    for (const TrackedFrame& frame : result_.frames) {
      poses.push_back(frame.dofs);
      trusted.push_back(frame.trusted());
    }
    if (std::find(trusted.begin(), trusted.end(), true) == trusted.end())
      fail(
          "sequence {}: the person was found in none of its {} frames; check that keypoints, calibration and "
          "landmarks belong together (the mean confidence may be too low, or too few cameras see the person)",
          result_.sequence.name, trusted.size());
    std::vector<long> cuts;
    for (const long cut : result_.sequence.cuts) cuts.push_back(cut - result_.sequence.first_frame);
    const auto& root = tracker_.model().root();
    bridge_poses(poses, trusted, cuts, root);
    smooth_poses(poses, cuts, root, options_.config.smoothing);
    result_.motion.frames.assign(static_cast<std::size_t>(result_.sequence.first_frame), poses.front());
    result_.motion.frames.insert(result_.motion.frames.end(), poses.begin(), poses.end());
    for (int row = 0; row < result_.motion.num_frames(); ++row) result_.motion.ids.push_back(row);
  }

  const Footage& footage_;
  const TrackOptions& options_;
  int index_;
  MultiviewTracker tracker_;
  TrackedSequence result_;
};

/// Tracks all once with the template as it is, and finds how it is worn.
Character worn_character(const Footage& footage, const TrackOptions& options, const std::vector<int>& chosen,
                         Progress& progress) {
  TrackOptions quiet = options;
  quiet.sheet_frames = 0;
  WornTemplate worn(footage, options.config.surface);
  for (const int s : chosen) {
    const TrackedSequence first = SequenceRun(footage, footage.character(), quiet, s).run(progress);
    worn.add(s, spread_frames(first.sequence, options.config.worn_frames), first.motion, progress);
  }
  return worn.character();
}

void write_vertices(const fs::path& path, const Footage& footage, const TrackedSequence& tracked) {
  const Character& character = footage.character();
  const PoseModel model(character, {}, {});
  NpyStream stream(path, {character.num_vertices(), 3});
  std::vector<float> frame;
  for (long row = tracked.sequence.first_frame; row <= tracked.sequence.last_frame; ++row) {
    frame.clear();
    const PosedBody body = model.pose(tracked.motion.frames[static_cast<std::size_t>(row)], false);
    for (const Eigen::Vector3d& vertex : posed_vertices(model, body))
      for (const double x : vertex) frame.push_back(static_cast<float>(x));
    stream.append(frame.data());
  }
  stream.close();
}

void write_sequence(const Footage& footage, const TrackOptions& options, const TrackedSequence& tracked) {
  const fs::path stem = options.out / tracked.sequence.name;
  const Character& character = footage.character();
  write_motion(stem.string() + ".motion", tracked.motion, true);
  write_bvh(stem.string() + ".bvh",
            bvh_from_motion(character.skeleton, tracked.motion, footage.capture().fps, character.rest_dofs));
  if (options.vertices && !options.surface) write_vertices(stem.string() + "_vertices.npy", footage, tracked);
}

// ---- what is reported ----

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

ordered_json surface_json(const TrackedSurface& surface) {
  const auto count = static_cast<double>(surface.frames.size());
  double posed = 0.0, bent = 0.0, steps = 0.0;
  ordered_json frames = ordered_json::array();
  for (const SurfaceFrame& frame : surface.frames) {
    posed += frame.posed_overlap;
    bent += frame.overlap;
    steps += frame.iterations;
    ordered_json terms;
    for (const TermCost& term : frame.terms) terms[term.name] = term.cost;
    frames.push_back({{"IoU_pose", frame.posed_overlap},
                      {"IoU", frame.overlap},
                      {"steps", frame.iterations},
                      {"stopped_by", to_string(frame.reason)},
                      {"costs", terms}});
  }
  return {{"IoU_pose", posed / count},
          {"IoU", bent / count},
          {"steps_per_frame", steps / count},
          {"frames_per_second", surface.seconds > 0.0 ? count / surface.seconds : 0.0},
          {"per_frame", frames}};
}

ordered_json sequence_json(const Footage& footage, const TrackedSequence& tracked) {
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
  if (tracked.surface) result["surface"] = surface_json(*tracked.surface);
  result["per_frame"] = frames;
  return result;
}

/// The capture with the tracked motions in the place of its own.
void write_tracked_capture(const Footage& footage, const TrackOptions& options,
                           const std::vector<TrackedSequence>& tracked) {
  Capture capture = footage.capture();
  for (SequenceEntry& entry : capture.sequences)
    for (const TrackedSequence& sequence : tracked) {
      if (sequence.sequence.name != entry.name) continue;
      const fs::path motion = fs::absolute(options.out / (entry.name + ".motion")).lexically_normal();
      const fs::path inside = motion.lexically_relative(capture.root);
      entry.motion = inside.empty() || *inside.begin() == ".." ? motion.string() : inside.string();
      entry.first_frame = sequence.sequence.first_frame;
      entry.last_frame = sequence.sequence.last_frame;
    }
  const auto untracked = [](const SequenceEntry& entry) { return entry.motion.empty(); };
  capture.sequences.erase(std::remove_if(capture.sequences.begin(), capture.sequences.end(), untracked),
                          capture.sequences.end());
  write_capture(options.out / "capture.yaml", capture);
}

void check_out_folder(const Footage& footage, const fs::path& out) {
  if (out.empty()) fail<UsageError>("no folder to write into was given");
  const fs::path& file = footage.capture().file;
  if (!file.empty() && fs::weakly_canonical(out / "capture.yaml") == fs::weakly_canonical(file))
    fail<UsageError>("{} holds the capture itself; write into a folder of its own with --out", out.string());
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

ordered_json track_capture(const Footage& footage, const TrackOptions& options) {
  check_out_folder(footage, options.out);
  fs::create_directories(options.out);
  const std::vector<int> chosen = chosen_sequences(footage, options.sequences);
  long total = 0;
  for (const int s : chosen) {
    const long frames = footage.sequences()[static_cast<std::size_t>(s)].num_frames();
    total += options.limit_frames > 0 ? std::min(options.limit_frames, frames) : frames;
  }
  const int passes = 1 + (options.config.worn_frames > 0) + options.surface;
  Progress progress("track", passes * total);
  std::optional<Character> worn;
  if (options.config.worn_frames > 0) worn = worn_character(footage, options, chosen, progress);
  ordered_json report{{"method", "multiview"}, {"sequences", ordered_json::object()}};
  std::vector<TrackedSequence> tracked;
  for (const int s : chosen) {
    tracked.push_back(SequenceRun(footage, worn ? *worn : footage.character(), options, s).run(progress));
    TrackedSequence& sequence = tracked.back();
    if (options.surface)
      sequence.surface = track_surface(footage, s, sequence.sequence, sequence.motion, options.config.surface,
                                       options.out / sequence.sequence.name, options.vertices, progress);
    write_sequence(footage, options, tracked.back());
    report["sequences"][tracked.back().sequence.name] = sequence_json(footage, tracked.back());
  }
  progress.finish();
  write_tracked_capture(footage, options, tracked);
  write_atomically(options.out / "track.json", report.dump(1) + "\n");
  return report;
}

}  // namespace doppel
