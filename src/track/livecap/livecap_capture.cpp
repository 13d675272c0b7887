#include "doppel/track/livecap/livecap_capture.h"

#include <optional>

#include "doppel/core/as_size.h"
#include "doppel/core/process.h"
#include "doppel/core/progress.h"
#include "doppel/track/livecap/surface_file.h"
#include "doppel/track/method_trackers.h"
#include "doppel/track/sequence_runner.h"
#include "doppel/track/thread_share.h"
#include "doppel/track/track_results.h"

namespace doppel {

namespace {

constexpr int kFramesAhead = 2;  // the delay of the thesis (4.7.3)

/// The work that LiveCap adds to a run: a file of vertices, overlaps with the masks, and the preview.
class LivecapOutputs {
 public:
  LivecapOutputs(const Footage& footage, const FrameTracker& tracker, const LivecapCaptureOptions& options,
                 const FootageSequence& sequence, Preview* preview)
      : footage_(footage),
        tracker_(tracker),
        preview_(preview),
        name_(sequence.name),
        first_frame_(sequence.first_frame),
        viewer_(footage.character(), footage.cameras().front(), options.config.fit.outline_pixels) {
    if (!options.vertices) return;
    path_ = options.out / (sequence.name + "_vertices.npy");
    file_.emplace(path_, footage.character().num_vertices(), options.config.filter);
  }

  void add(long frame, const FootageFrame& seen, const FrameResult& found) {
    measure_overlap(frame, seen, found);
    if (file_) file_->add(found.vertices, found.pose.state == FrameState::tracked);
    const std::string note = fmt::format("{} {}", name_, to_string(found.pose.state));
    if (preview_ && !preview_->show(seen.images.front(), found.vertices, note)) request_stop();
  }

  /// Completes the file. @return its path; empty when none is written
  std::filesystem::path close() {
    if (file_) file_->close();
    return path_;
  }
  std::vector<LivecapOverlap> overlaps() const { return overlaps_; }

 private:
  void measure_overlap(long frame, const FootageFrame& seen, const FrameResult& found) {
    if (!found.pose.found() || seen.evidence.front().outline.empty()) return;
    const PoseModel& model = tracker_.model();
    const PosedSurface posed =
        pose_surface(model, model.pose(found.pose.dofs, false), footage_.character().mesh.vertices);
    const cv::Mat& mask = seen.masks.front();
    overlaps_.push_back(
        {as_size(frame - first_frame_), viewer_.overlap(posed.vertices, mask), viewer_.overlap(found.vertices, mask)});
  }

  const Footage& footage_;
  const FrameTracker& tracker_;
  Preview* preview_;
  std::string name_;
  long first_frame_;
  SurfaceViewer viewer_;
  std::filesystem::path path_;
  std::optional<SurfaceFile> file_;
  std::vector<LivecapOverlap> overlaps_;
};

SequenceReport track_sequence(const Footage& footage, const LivecapCaptureOptions& options,
                              const FootageSequence& sequence, Preview* preview, Progress& progress) {
  const auto tracker =
      make_livecap_tracker(footage.character(), footage.landmarks(), footage.cameras().front(), options.config);
  LivecapOutputs outputs(footage, *tracker, options, sequence, preview);
  SequenceRunner runner(footage, *tracker,
                        {options.sheet_frames, options.out / (sequence.name + ".jpg"), kFramesAhead});
  runner.on_frame(
      [&](long frame, const FootageFrame& seen, const FrameResult& found) { outputs.add(frame, seen, found); });
  TrackedSequence tracked = runner.run(sequence, progress);
  make_motion(tracked, tracker->model().root(), options.config.smoothing);
  tracked.vertices = outputs.close();
  write_poses(footage.character(), footage.capture().fps, options.out, tracked);
  SequenceReport report = report_of(footage, std::move(tracked));
  report.livecap = outputs.overlaps();
  return report;
}

}  // namespace

TrackReport track_livecap(const Footage& footage, const LivecapCaptureOptions& options, Preview* preview) {
  check_one_camera(footage);
  open_out_folder(footage, options.out, "livecap");
  const std::vector<FootageSequence> chosen = chosen_sequences(footage, options);
  warn_without_masks(chosen);
  const OneThreadFewer while_reading;
  Progress progress("track", count_frames(chosen));
  TrackReport report;
  report.method = "livecap";
  for (const FootageSequence& sequence : chosen) {
    if (is_stopped(report)) break;
    report.sequences.push_back(track_sequence(footage, options, sequence, preview, progress));
  }
  progress.finish();
  if (preview) preview->close();
  write_results(footage, options, report);
  return report;
}

}  // namespace doppel
