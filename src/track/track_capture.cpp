#include "doppel/track/track_capture.h"

#include <optional>

#include "doppel/core/error.h"
#include "doppel/core/progress.h"
#include "doppel/track/energy/outline.h"
#include "doppel/track/frame_file.h"
#include "doppel/track/method_trackers.h"
#include "doppel/track/multiview/shared_dofs_fit.h"
#include "doppel/track/sequence_runner.h"
#include "doppel/track/track_results.h"
#include "doppel/track/track_surface.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

constexpr int kSmoothingDegree = 2;  // a weighted mean would flatten fast motions of limbs

/// Tracks one sequence, from its frames to its motion. @param character with the template to fit
TrackedSequence track_sequence(const Footage& footage, const Character& character, const TrackOptions& options,
                               const FootageSequence& sequence, Progress& progress) {
  const auto tracker = make_multiview_tracker(footage, character, options.config);
  SequenceRunner runner(footage, *tracker, {options.sheet_frames, options.out / (sequence.name + ".jpg")});
  TrackedSequence tracked = runner.run(sequence, progress);
  make_motion(tracked, tracker->model().root(), options.config.smoothing, kSmoothingDegree);
  return tracked;
}

/// Tracks a sequence for the first pass, which uses all frames.
TrackedSequence track_whole_sequence(const Footage& footage, const Character& character, const TrackOptions& options,
                                     const FootageSequence& sequence, Progress& progress) {
  TrackedSequence tracked = track_sequence(footage, character, options, sequence, progress);
  if (!tracked.stopped.empty())
    fail("the first pass over the sequence {} did not come to its end, and nothing was written: {}", sequence.name,
         tracked.stopped);
  return tracked;
}

/// The first pass: tracks all sequences once to fit the shared DoFs and the template.
class FirstPass {
 public:
  FirstPass(const Footage& footage, const TrackOptions& options, const std::vector<FootageSequence>& chosen,
            Progress& progress)
      : footage_(footage), options_(options), progress_(progress), character_(footage.character()) {
    DofChoice& dofs = options_.config.dofs;
    dofs.hold.insert(dofs.hold.end(), options.config.shared_dofs.begin(), options.config.shared_dofs.end());
    options_.sheet_frames = 0;
    shared_.weight = options.config.fit.shared_dofs.weight;
    shared_.dofs = named_dofs(character_.skeleton, "shared_dofs.dofs", options.config.shared_dofs);
    for (const FootageSequence& sequence : chosen)
      tracked_.push_back(track_whole_sequence(footage, character_, options_, sequence, progress_));
    fit_shared();
    if (options.config.template_frames == 0) return;
    fit_template();
    fit_shared();
  }
  const Character& character() const { return character_; }
  const SharedDofs& shared_dofs() const { return shared_; }

 private:
  void fit_shared() {
    if (shared_.dofs.empty()) return;
    if (frames_.empty()) read_frames();
    shared_.values = fit_shared_dofs(character_, footage_.landmarks(), footage_.cameras(), shared_.dofs, frames_,
                                     options_.config.fit);
    for (TrackedSequence& tracked : tracked_)
      for (std::vector<double>& dofs : tracked.motion.frames) shared_.put_into(dofs);
  }
  /// Runs once for both fits; each replaces the shared DoFs in the poses by its own values.
  void read_frames() {
    for (const TrackedSequence& tracked : tracked_) {
      const auto reader = footage_.read(tracked.sequence.index);
      for (const long frame : spread_frames(tracked.sequence, options_.config.shared_frames)) {
        check_not_stopped(tracked.sequence, frame);
        frames_.push_back({reader->read(frame, false).evidence, tracked.motion.frames[frame]});
      }
    }
  }
  void fit_template() {
    TemplateFit fit(footage_.character(), footage_.landmarks(), footage_.cameras(), options_.config.surface);
    for (const TrackedSequence& tracked : tracked_) {
      const auto reader = footage_.read(tracked.sequence.index);
      for (const long frame : spread_frames(tracked.sequence, options_.config.template_frames)) {
        check_not_stopped(tracked.sequence, frame);
        fit.add(reader->read(frame, false).evidence, tracked.motion.frames[frame]);
        progress_.advance(1, "template");
      }
    }
    character_ = fit.character();
  }

  const Footage& footage_;
  TrackOptions options_;
  Progress& progress_;
  Character character_;
  std::vector<TrackedSequence> tracked_;
  std::vector<PosedEvidence> frames_;  ///< to which the shared DoFs are fitted
  SharedDofs shared_;
};

void write_vertices(const fs::path& path, const Footage& footage, const TrackedSequence& tracked) {
  const PoseModel model(footage.character(), {}, {});
  FrameFile file(path, footage.character().num_vertices(), 3);
  for (long row = tracked.sequence.first_frame; row <= tracked.sequence.last_frame; ++row)
    file.append(posed_vertices(model, model.pose(tracked.motion.frames[row], false)));
  file.close();
}

std::vector<std::pair<std::string, double>> named_values(const Character& character, const SharedDofs& shared) {
  std::vector<std::pair<std::string, double>> values;
  for (std::size_t i = 0; i < shared.dofs.size(); ++i)
    values.emplace_back(character.skeleton.dofs[shared.dofs[i]].name, shared.values[i]);
  return values;
}

/// The second pass of a sequence, and its files.
SequenceReport finish_sequence(const Footage& footage, const Character& character, const TrackOptions& options,
                               const FootageSequence& sequence, Progress& progress) {
  TrackedSequence tracked = track_sequence(footage, character, options, sequence, progress);
  write_poses(footage.character(), footage.capture().fps, options.out, tracked);
  if (options.surface)
    run_second_pass(tracked, [&] {
      tracked.surface = track_surface(footage, sequence, tracked.motion, options.config.surface,
                                      options.out / sequence.name, options.vertices, progress);
    });
  if (options.vertices) tracked.vertices = options.out / (sequence.name + "_vertices.npy");
  if (options.vertices && !tracked.surface) write_vertices(tracked.vertices, footage, tracked);
  return report_of(footage, std::move(tracked));
}

}  // namespace

TrackReport track_capture(const Footage& footage, const TrackOptions& wanted) {
  TrackOptions options = wanted;
  open_out_folder(footage, options.out, "multiview");
  const std::vector<FootageSequence> chosen = chosen_sequences(footage, options);
  if (options.surface) require_masks(footage, chosen, "`doppel track --surface`");
  if (options.config.template_frames > 0) require_masks(footage, chosen, "the template fit (`template_fit.frames`)");
  warn_without_masks(chosen);
  const bool twice = options.config.template_frames > 0 || !options.config.shared_dofs.empty();
  const long bent = options.config.template_frames * static_cast<long>(chosen.size());
  if (twice && options.shard)
    fail<UsageError>(
        "--shard: `shared_dofs` and `template_fit` are fitted to all sequences together; leave --shard out, or set "
        "shared_dofs.dofs=[] and template_fit.frames=0");
  Progress progress("track", (1 + twice + options.surface) * count_frames(chosen) + bent);
  TrackReport report;
  report.method = "multiview";
  report.bone_scales = options.bone_scales;
  std::optional<FirstPass> first;
  if (twice) {
    options.config.fit.shared_dofs = first.emplace(footage, options, chosen, progress).shared_dofs();
    report.shared_dofs = named_values(footage.character(), first->shared_dofs());
  }
  const Character& character = first ? first->character() : footage.character();
  for (const FootageSequence& sequence : chosen) {
    if (is_stopped(report)) break;
    report.sequences.push_back(finish_sequence(footage, character, options, sequence, progress));
  }
  progress.finish();
  write_results(footage, options, report);
  return report;
}

}  // namespace doppel
