#include "doppel/track/livecap/livecap_capture.h"

#include <fmt/format.h>

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <optional>

#include "doppel/core/process.h"
#include "doppel/core/progress.h"
#include "doppel/track/clock.h"
#include "doppel/track/livecap/livecap_input.h"
#include "doppel/track/livecap/surface_file.h"
#include "doppel/track/prefetch.h"
#include "doppel/track/thread_share.h"
#include "doppel/track/track_sheet.h"
#include "doppel/track/tracked_sequence.h"

namespace doppel {

using nlohmann::ordered_json;

namespace {

constexpr std::size_t kFramesAhead = 2;  // the delay that the thesis has (4.7.3)

/// A frame on its way from the reading thread.
struct ReadFrame {
  long frame = 0;
  FootageFrame seen;
  double seconds = 0.0;
};

/// What is measured on the way.
struct Figures {
  double reading = 0.0, pose = 0.0, surface = 0.0;  ///< seconds of each stage, summed
  double total = 0.0;                               ///< seconds from the first frame to the last
  struct Overlap {
    std::size_t frame;  ///< from the first
    double pose, surface;
  };
  std::vector<Overlap> overlaps;  ///< of frames that are trusted and have a mask
};

class LivecapRun {
 public:
  LivecapRun(const Footage& footage, const LivecapCaptureOptions& options, const FootageSequence& sequence,
             Preview* preview)
      : footage_(footage),
        options_(options),
        preview_(preview),
        tracker_(footage.character(), footage.landmarks(),
                 chosen_dofs(options.config.dofs, footage.character().skeleton, footage.landmarks()),
                 footage.cameras().front(), options.config.fit),
        viewer_(footage.character(), footage.cameras().front(), options.config.fit.outline_pixels) {
    result_.sequence = sequence;
  }

  TrackedSequence run(Progress& progress) {
    const FootageSequence& sequence = result_.sequence;
    const std::vector<long> shown = spread_frames(sequence, options_.sheet_frames);
    TrackSheet sheet(footage_.cameras(), tracker_.model(), options_.config.fit.outline_pixels);
    std::optional<SurfaceFile> file;
    if (options_.vertices) {
      result_.vertices = options_.out / (sequence.name + "_vertices.npy");
      file.emplace(result_.vertices, footage_.character().num_vertices(), options_.config.filter);
    }
    const auto reader = footage_.read(sequence.index);
    const auto start = Clock::now();
    Prefetch<ReadFrame> frames([&, next = sequence.first_frame]() mutable { return read(*reader, next); },
                               kFramesAhead);
    while (const std::optional<ReadFrame> read = frames.next()) {
      check_not_stopped(sequence, read->frame);
      const LivecapFrame found = track(*read);
      if (file) file->add(found.vertices, found.pose.state == FrameState::tracked);
      if (std::find(shown.begin(), shown.end(), read->frame) != shown.end())
        sheet.add(read->frame, read->seen, found.pose);
      const std::string note = fmt::format("{} {}", sequence.name, to_string(found.pose.state));
      if (preview_ && !preview_->show(read->seen.pictures.front(), found.vertices, note)) request_stop();
      progress.advance(1, note);
    }
    figures_.total = seconds_since(start);
    result_.seconds = figures_.pose + figures_.surface;
    make_motion(result_, tracker_.model().root(), options_.config.smoothing);
    if (file) file->close();
    if (!sheet.empty()) cv::imwrite((options_.out / (sequence.name + ".jpg")).string(), sheet.image());
    return std::move(result_);
  }

  const Figures& figures() const { return figures_; }

 private:
  std::optional<ReadFrame> read(FootageReader& reader, long& next) const {
    if (next > result_.sequence.last_frame) return std::nullopt;
    const auto start = Clock::now();
    ReadFrame result;
    result.frame = next++;
    result.seen = reader.read(result.frame, true);
    result.seconds = seconds_since(start);
    return result;
  }

  LivecapFrame track(const ReadFrame& read) {
    if (result_.sequence.begins_segment(read.frame)) tracker_.cut();
    LivecapFrame found = tracker_.track(livecap_input(read.seen));
    figures_.reading += read.seconds;
    figures_.pose += found.pose_seconds;
    figures_.surface += found.surface_seconds;
    const cv::Mat& mask = read.seen.masks.front();
    if (found.pose.trusted() && !read.seen.evidence.front().outline.empty()) {
      const PosedBody body = tracker_.model().pose(found.pose.dofs, false);
      const PosedSurface posed = pose_surface(tracker_.model(), body, footage_.character().mesh.vertices);
      figures_.overlaps.push_back(
          {result_.frames.size(), viewer_.overlap(posed.vertices, mask), viewer_.overlap(found.vertices, mask)});
    }
    result_.frames.push_back(found.pose);
    return found;
  }

  const Footage& footage_;
  const LivecapCaptureOptions& options_;
  Preview* preview_;
  LivecapTracker tracker_;
  SurfaceViewer viewer_;
  TrackedSequence result_;
  Figures figures_;
};

/// Adds figures to the report of a sequence, and to those of its frames.
void add_figures(const Figures& figures, ordered_json& entry) {
  const double count = entry["frames"].get<double>();
  double pose = 0.0, surface = 0.0;
  for (const Figures::Overlap& overlap : figures.overlaps) {
    pose += overlap.pose / static_cast<double>(figures.overlaps.size());
    surface += overlap.surface / static_cast<double>(figures.overlaps.size());
    ordered_json& frame = entry["per_frame"][overlap.frame];
    frame["IoU_of_pose"] = overlap.pose;
    frame["IoU_of_surface"] = overlap.surface;
  }
  entry["livecap"] = {{"IoU_pose", pose},
                      {"IoU", surface},
                      {"frames_per_second", figures.total > 0.0 ? count / figures.total : 0.0},
                      {"milliseconds",
                       {{"read", 1e3 * figures.reading / count},
                        {"pose", 1e3 * figures.pose / count},
                        {"surface", 1e3 * figures.surface / count},
                        {"frame", 1e3 * figures.total / count}}}};
}

}  // namespace

ordered_json track_livecap(const Footage& footage, const LivecapCaptureOptions& options, Preview* preview) {
  check_one_camera(footage);
  open_out_folder(footage, options.out);
  const std::vector<FootageSequence> chosen = chosen_sequences(footage, options);
  const OneThreadFewer while_reading;
  Progress progress("track", count_frames(chosen));
  ordered_json report{{"method", "livecap"}, {"sequences", ordered_json::object()}};
  std::vector<TrackedSequence> tracked;
  for (const FootageSequence& sequence : chosen) {
    LivecapRun run(footage, options, sequence, preview);
    tracked.push_back(run.run(progress));
    write_poses(footage.character(), footage.capture().fps, options.out, tracked.back());
    ordered_json& entry = report["sequences"][sequence.name] = report_of(footage, tracked.back());
    add_figures(run.figures(), entry);
  }
  progress.finish();
  if (preview) preview->close();
  write_results(footage, options.out, tracked, report);
  return report;
}

}  // namespace doppel
