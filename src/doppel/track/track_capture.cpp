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
    make_motion(result_, tracker_.model().root(), options_.config.smoothing);
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

// ---- what is reported ----

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

}  // namespace

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
    write_poses(footage, options.out, sequence);
    if (options.vertices && !options.surface)
      write_vertices(options.out / (sequence.sequence.name + "_vertices.npy"), footage, sequence);
    ordered_json& entry = report["sequences"][sequence.sequence.name] = report_of(footage, sequence);
    if (sequence.surface) entry["surface"] = surface_json(*sequence.surface);
  }
  progress.finish();
  write_tracked_capture(footage, options.out, tracked);
  write_atomically(options.out / "track.json", report.dump(1) + "\n");
  return report;
}

}  // namespace doppel
