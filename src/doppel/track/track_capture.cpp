#include "doppel/track/track_capture.h"

#include <fmt/format.h>

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <optional>

#include "doppel/core/progress.h"
#include "doppel/track/clock.h"
#include "doppel/track/frame_file.h"
#include "doppel/track/outline.h"
#include "doppel/track/track_sheet.h"
#include "doppel/track/track_surface.h"
#include "doppel/track/tracked_sequence.h"
#include "doppel/track/usual_fit.h"

namespace doppel {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

namespace {

constexpr int kSmoothingDegree = 2;  // a mean would lag where limbs swing

/// One sequence, from its frames to its files.
class SequenceRun {
 public:
  /// @param character with the template to fit
  SequenceRun(const Footage& footage, const Character& character, const TrackOptions& options,
              const FootageSequence& sequence)
      : footage_(footage),
        options_(options),
        tracker_(character, footage.landmarks(),
                 chosen_dofs(options.config.dofs, footage.character().skeleton, footage.landmarks()), footage.cameras(),
                 options.config.fit) {
    result_.sequence = sequence;
  }

  TrackedSequence run(Progress& progress) {
    const FootageSequence& sequence = result_.sequence;
    const auto reader = footage_.read(sequence.index);
    const std::vector<long> shown = spread_frames(sequence, options_.sheet_frames);
    TrackSheet sheet(footage_.cameras(), tracker_.model(), options_.config.fit.outline_pixels);
    for (long frame = sequence.first_frame; frame <= sequence.last_frame; ++frame) {
      check_not_stopped(sequence, frame);
      const bool show = std::find(shown.begin(), shown.end(), frame) != shown.end();
      const FootageFrame seen = reader->read(frame, show);
      track(frame, seen.evidence);
      if (show) sheet.add(frame, seen, result_.frames.back());
      progress.advance(1, fmt::format("{} {}", sequence.name, to_string(result_.frames.back().state)));
    }
    make_motion(result_, tracker_.model().root(), options_.config.smoothing, kSmoothingDegree);
    if (!sheet.empty()) cv::imwrite((options_.out / (sequence.name + ".jpg")).string(), sheet.image());
    return std::move(result_);
  }

 private:
  void track(long frame, const FrameEvidence& evidence) {
    if (result_.sequence.begins_segment(frame)) tracker_.cut();
    const auto start = Clock::now();
    result_.frames.push_back(tracker_.track(evidence));
    result_.seconds += seconds_since(start);
  }

  const Footage& footage_;
  const TrackOptions& options_;
  MultiviewTracker tracker_;
  TrackedSequence result_;
};

/// What is learnt of the person by tracking everything once: usual values of DoFs that no landmark shows, and how the
/// template is worn.
class FirstPass {
 public:
  FirstPass(const Footage& footage, const TrackOptions& options, const std::vector<FootageSequence>& chosen,
            Progress& progress)
      : footage_(footage), options_(options), progress_(progress), character_(footage.character()) {
    DofChoice& dofs = options_.config.dofs;
    dofs.hold.insert(dofs.hold.end(), options.config.usual.begin(), options.config.usual.end());
    options_.sheet_frames = 0;
    usual_.weight = options.config.fit.usual.weight;
    usual_.dofs = named_dofs(character_.skeleton, "usual.dofs", options.config.usual);
    for (const FootageSequence& sequence : chosen)
      tracked_.push_back(SequenceRun(footage, character_, options_, sequence).run(progress_));
    find_usual();
    if (options.config.worn_frames == 0) return;
    find_worn();
    find_usual();
  }
  const Character& character() const { return character_; }
  const UsualPose& usual() const { return usual_; }

 private:
  void find_usual() {
    if (usual_.dofs.empty()) return;
    if (frames_.empty()) read_frames();
    usual_.values = find_usual_values(character_, footage_.landmarks(), footage_.cameras(), usual_.dofs, frames_,
                                      options_.config.fit);
    for (TrackedSequence& tracked : tracked_)
      for (std::vector<double>& dofs : tracked.motion.frames) usual_.put_into(dofs);
  }
  /// Once for both fits: they put the usual DoFs' values of their own in the place of those of the poses.
  void read_frames() {
    for (const TrackedSequence& tracked : tracked_) {
      const auto reader = footage_.read(tracked.sequence.index);
      for (const long frame : spread_frames(tracked.sequence, options_.config.usual_frames)) {
        check_not_stopped(tracked.sequence, frame);
        frames_.push_back(
            {reader->read(frame, false).evidence, tracked.motion.frames[static_cast<std::size_t>(frame)]});
      }
    }
  }
  void find_worn() {
    WornTemplate worn(footage_, options_.config.surface);
    for (const TrackedSequence& tracked : tracked_)
      worn.add(tracked.sequence, spread_frames(tracked.sequence, options_.config.worn_frames), tracked.motion,
               progress_);
    character_ = worn.character();
  }

  const Footage& footage_;
  TrackOptions options_;
  Progress& progress_;
  Character character_;
  std::vector<TrackedSequence> tracked_;
  std::vector<PosedEvidence> frames_;  ///< that the usual values are found from
  UsualPose usual_;
};

void write_vertices(const fs::path& path, const Footage& footage, const TrackedSequence& tracked) {
  const PoseModel model(footage.character(), {}, {});
  FrameFile file(path, footage.character().num_vertices(), 3);
  for (long row = tracked.sequence.first_frame; row <= tracked.sequence.last_frame; ++row)
    file.append(posed_vertices(model, model.pose(tracked.motion.frames[static_cast<std::size_t>(row)], false)));
  file.close();
}

// ---- what is reported ----

ordered_json usual_json(const Character& character, const UsualPose& usual) {
  ordered_json values;
  for (std::size_t i = 0; i < usual.dofs.size(); ++i)
    values[character.skeleton.dofs[static_cast<std::size_t>(usual.dofs[i])].name] = usual.values[i];
  return values;
}

ordered_json surface_json(const TrackedSurface& surface) {
  const auto count = static_cast<double>(surface.frames.size());
  double posed = 0.0, bent = 0.0, steps = 0.0;
  ordered_json frames = ordered_json::array();
  for (const SurfaceFrame& frame : surface.frames) {
    posed += frame.posed_overlap;
    bent += frame.overlap;
    steps += frame.iterations;
    frames.push_back({{"IoU_pose", frame.posed_overlap},
                      {"IoU", frame.overlap},
                      {"steps", frame.iterations},
                      {"stopped_by", to_string(frame.reason)},
                      {"costs", costs_json(frame.terms)}});
  }
  return {{"IoU_pose", posed / count},
          {"IoU", bent / count},
          {"steps_per_frame", steps / count},
          {"frames_per_second", surface.seconds > 0.0 ? count / surface.seconds : 0.0},
          {"per_frame", frames}};
}

}  // namespace

ordered_json track_capture(const Footage& footage, const TrackOptions& wanted) {
  TrackOptions options = wanted;
  open_out_folder(footage, options.out);
  const std::vector<FootageSequence> chosen = chosen_sequences(footage, options);
  const bool twice = options.config.worn_frames > 0 || !options.config.usual.empty();
  const long bent = options.config.worn_frames * static_cast<long>(chosen.size());
  Progress progress("track", (1 + twice + options.surface) * count_frames(chosen) + bent);
  std::optional<FirstPass> first;
  if (twice) options.config.fit.usual = first.emplace(footage, options, chosen, progress).usual();
  ordered_json report{{"method", "multiview"}, {"sequences", ordered_json::object()}};
  if (first && !first->usual().dofs.empty()) report["usual"] = usual_json(footage.character(), first->usual());
  std::vector<TrackedSequence> tracked;
  for (const FootageSequence& chosen_one : chosen) {
    const Character& character = first ? first->character() : footage.character();
    tracked.push_back(SequenceRun(footage, character, options, chosen_one).run(progress));
    TrackedSequence& sequence = tracked.back();
    if (options.surface)
      sequence.surface = track_surface(footage, sequence.sequence, sequence.motion, options.config.surface,
                                       options.out / sequence.sequence.name, options.vertices, progress);
    write_poses(footage.character(), footage.capture().fps, options.out, sequence);
    if (options.vertices) sequence.vertices = options.out / (sequence.sequence.name + "_vertices.npy");
    if (options.vertices && !options.surface) write_vertices(sequence.vertices, footage, sequence);
    ordered_json& entry = report["sequences"][sequence.sequence.name] = report_of(footage, sequence);
    if (sequence.surface) entry["surface"] = surface_json(*sequence.surface);
  }
  progress.finish();
  write_results(footage, options.out, tracked, report);
  return report;
}

}  // namespace doppel
