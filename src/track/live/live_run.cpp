#include "doppel/track/live/live_run.h"

#include <algorithm>
#include <atomic>
#include <memory>
#include <optional>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/core/process.h"
#include "doppel/track/energy/root_rotation.h"
#include "doppel/track/live/frame_log.h"
#include "doppel/track/livecap/surface_file.h"
#include "doppel/track/prefetch.h"
#include "doppel/track/thread_share.h"
#include "doppel/track/tracked_sequence.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

constexpr double kPatience = 0.05;       // seconds that the calling thread waits for a result at a time
constexpr double kBetweenReports = 5.0;  // seconds
constexpr char kName[] = "live";
constexpr std::size_t kSettled = 100;  // frames after which all buffers have their final size

/// An image on its way through the stages.
struct SeenImage {
  SourceImage source;
  FootageFrame seen;
};

/// A result to show.
struct Shown {
  cv::Mat image;
  Eigen::Matrix3Xd vertices;
  LiveState state = LiveState::lost;
};

/// Mean and maximum of a repeatedly measured time.
struct Timing {
  double sum = 0.0, largest = 0.0;
  long count = 0;

  void add(double seconds) {
    sum += seconds;
    largest = std::max(largest, seconds);
    ++count;
  }
  double mean_ms() const { return count > 0 ? 1e3 * sum / static_cast<double>(count) : 0.0; }
};

LiveState live_state(FrameState state) {
  if (state == FrameState::lost) return LiveState::lost;
  return state == FrameState::recovered ? LiveState::recovered : LiveState::tracking;
}

/// Measurements of the stages. Only one stage writes each figure; it is read when all stages have ended.
struct LiveTimings {
  Timing capture, preprocess, detect, pose, surface, latency;
  long behind = 0;                                  ///< largest number of images that arrived during one frame
  long first_image = 0, last_image = 0;             ///< numbers of the first and the last tracked image
  std::vector<std::pair<long, LiveState>> changes;  ///< image, and the state from this image on
  double settled_megabytes = 0.0;                   ///< main memory after the first hundred frames
  double final_megabytes = 0.0;                     ///< main memory after the last frame, before files are written
  Clock::time_point first, last;                    ///< times of the first and the last result
};

class LiveRun {
 public:
  LiveRun(FrameSource& source, LiveView& view, FrameTracker& tracker, const LiveRunOptions& options, Preview* preview)
      : source_(source),
        view_(view),
        tracker_(tracker),
        options_(options),
        preview_(preview),
        log_(options.out),
        images_([this] { return take(); }, 1, source.live() ? WhenFull::drop_oldest : WhenFull::wait),
        preprocessed_([this] { return preprocess(); }, 1),
        detected_(view.detects_at_once() ? nullptr : new Prefetch<SeenImage>([this] { return detect(); }, 1)),
        solved_([this] { return solve(); }, 1,
                preview && !preview->wants_all() ? WhenFull::drop_oldest : WhenFull::wait) {}

  /// Ends early at an image that cannot be read, which `stopped` of the result tells.
  void run() {
    try {
      follow_results();
    } catch (const FileError& e) {
      if (log_.size() == 0) throw;
      result_.stopped = e.what();
      log::warn("{}; the images before it are kept", e.what());
    }
    images_.finish();
    timings_.final_megabytes = private_megabytes();
    result_.frames = log_.read();
    if (preview_) preview_->close();
  }

  TrackedSequence& result() { return result_; }
  const LiveTimings& timings() const { return timings_; }
  long num_images() const { return came_; }
  long num_dropped() const { return images_.num_dropped(); }
  void close_file() {
    if (file_) file_->close();
  }

 private:
  void follow_results() {
    auto reported = Clock::now();
    while (true) {
      Prefetch<Shown>::Arrival arrival = solved_.next_within(kPatience);
      if (arrival.ended) break;
      const bool goes_on = arrival.thing ? show(*arrival.thing) : !preview_ || preview_->idle();
      if (!goes_on || stop_requested()) images_.stop();
      watch_for_silence();
      if (seconds_since(reported) < kBetweenReports) continue;
      reported = Clock::now();
      log::info("{}", caption());
    }
  }

  // ---- the stages, each on its thread ----

  std::optional<SourceImage> take() {
    if (options_.limit_frames > 0 && came_ >= options_.limit_frames) return std::nullopt;
    const auto start = Clock::now();
    std::optional<SourceImage> image = source_.next();
    if (!image) return image;
    timings_.capture.add(seconds_since(start));
    last_taken_ = image->taken;
    ++came_;
    return image;
  }

  std::optional<SeenImage> preprocess() {
    std::optional<SourceImage> image = images_.next();
    if (!image) return std::nullopt;
    const auto start = Clock::now();
    SeenImage result{std::move(*image), {}};
    result.seen = view_.preprocess(result.source);
    timings_.preprocess.add(seconds_since(start));
    return result;
  }

  std::optional<SeenImage> detect() {
    std::optional<SeenImage> image = preprocessed_.next();
    if (!image) return image;
    const auto start = Clock::now();
    view_.detect(image->source, image->seen);
    timings_.detect.add(seconds_since(start));
    return image;
  }

  std::optional<Shown> solve() {
    std::optional<SeenImage> image = detected_ ? detected_->next() : detect();
    if (!image) return std::nullopt;
    if (paused_before(image->source)) tracker_.pause();
    FrameResult found = tracker_.track(image->seen);
    record(image->source, found);
    return Shown{image->seen.images.front(), std::move(found.vertices), live_state(found.pose.state)};
  }

  bool paused_before(const SourceImage& image) {
    const bool first = log_.size() == 0;
    const double gap = std::chrono::duration<double>(image.taken - solved_at_).count();
    solved_at_ = image.taken;
    return source_.live() && !first && gap > options_.silence;
  }

  void record(const SourceImage& image, const FrameResult& found) {
    const auto now = Clock::now();
    if (log_.size() == 0) {
      timings_.first = now;
      timings_.first_image = image.number;
    }
    timings_.last = now;
    timings_.last_image = image.number;
    timings_.latency.add(std::chrono::duration<double>(now - image.taken).count());
    timings_.behind = std::max(timings_.behind, came_ - 1 - image.number);
    timings_.pose.add(found.pose_seconds);
    timings_.surface.add(found.surface_seconds);
    note_state(image.number, live_state(found.pose.state));
    write_vertices(found);
    if (options_.on_pose)
      options_.on_pose(found.pose.dofs, std::chrono::duration<double>(now - timings_.first).count(),
                       found.pose.state != FrameState::lost);
    log_.append(found.pose);
    if (log_.size() == kSettled) timings_.settled_megabytes = private_megabytes();
    rate_ =
        static_cast<double>(log_.size()) / std::max(1e-9, std::chrono::duration<double>(now - timings_.first).count());
    latency_ms_ = timings_.latency.mean_ms();
  }

  void note_state(long number, LiveState state) {
    // A recovered frame is tracked from then on.
    const bool goes_on = !timings_.changes.empty() &&
                         (timings_.changes.back().second == state ||
                          (state == LiveState::tracking && timings_.changes.back().second == LiveState::recovered));
    state_ = state;
    if (goes_on) return;
    timings_.changes.emplace_back(number, state);
    log::info("image {}: {}", number, to_string(state));
  }

  void write_vertices(const FrameResult& found) {
    if (!options_.vertices) return;
    if (!file_)
      file_.emplace(options_.out / (std::string(kName) + "_vertices.npy"), view_.character().num_vertices(),
                    options_.filter);
    file_->add(found.vertices, found.pose.state == FrameState::tracked);
  }

  // ---- on the calling thread ----

  bool show(const Shown& shown) {
    if (!preview_) return true;
    return preview_->show(shown.image, shown.vertices, caption());
  }

  std::string caption() const {
    return fmt::format("{}  {:.1f} frames/s  latency {:.0f} ms  {} dropped", to_string(state_.load()), rate_.load(),
                       latency_ms_.load(), images_.num_dropped());
  }

  void watch_for_silence() {
    const bool silent = source_.live() && came_ > 0 && seconds_since(last_taken_) > options_.silence;
    if (silent && !silent_) {
      state_ = LiveState::lost;
      log::warn("{}: no image for {:.1f} seconds: {}", source_.name(), options_.silence, to_string(LiveState::lost));
    }
    silent_ = silent;
  }

  FrameSource& source_;
  LiveView& view_;
  FrameTracker& tracker_;
  const LiveRunOptions& options_;
  Preview* preview_;
  FrameLog log_;
  TrackedSequence result_;
  LiveTimings timings_;
  std::optional<SurfaceFile> file_;
  Clock::time_point solved_at_;
  std::atomic<Clock::time_point> last_taken_{Clock::time_point()};
  std::atomic<long> came_{0};
  std::atomic<LiveState> state_{LiveState::lost};
  std::atomic<double> rate_{0.0}, latency_ms_{0.0};
  bool silent_ = false;
  // Last, so that all other members exist when the threads begin. In this order, so that each stage ends before the
  // stage that feeds it.
  Prefetch<SourceImage> images_;
  Prefetch<SeenImage> preprocessed_;
  // Null where keypoints come from files: a stage of its own would only add an image that waits.
  std::unique_ptr<Prefetch<SeenImage>> detected_;
  Prefetch<Shown> solved_;
};

/// The mean frames per second of the tracked images: dropped ones have no row in the motion.
double tracked_rate(const FrameSource& source, LiveRun& run) {
  const auto span = static_cast<double>(run.timings().last_image - run.timings().first_image);
  const auto steps = static_cast<double>(run.result().frames.size()) - 1.0;
  return span > 0.0 ? source.frames_per_second() * steps / span : source.frames_per_second();
}

LiveFigures figures_of(const FrameSource& source, LiveRun& run) {
  const LiveTimings& timings = run.timings();
  const double seconds = std::chrono::duration<double>(timings.last - timings.first).count();
  const auto results = static_cast<double>(run.result().frames.size());
  LiveFigures figures;
  figures.source = source.name();
  figures.images = run.num_images();
  figures.dropped = run.num_dropped();
  figures.behind = timings.behind;
  figures.frames_per_second = seconds > 0.0 ? (results - 1.0) / seconds : 0.0;
  figures.latency_ms = timings.latency.mean_ms();
  figures.largest_latency_ms = 1e3 * timings.latency.largest;
  figures.capture_ms = timings.capture.mean_ms();
  figures.preprocess_ms = timings.preprocess.mean_ms();
  figures.detect_ms = timings.detect.mean_ms();
  figures.pose_ms = timings.pose.mean_ms();
  figures.surface_ms = timings.surface.mean_ms();
  figures.settled_megabytes = timings.settled_megabytes;
  figures.final_megabytes = timings.final_megabytes;
  for (const auto& [number, state] : timings.changes) figures.changes.emplace_back(number, to_string(state));
  return figures;
}

}  // namespace

const char* to_string(LiveState state) {
  switch (state) {
    case LiveState::tracking:
      return "tracking";
    case LiveState::lost:
      return "lost";
    case LiveState::recovered:
      return "recovered";
  }
  return "unknown";
}

TrackReport track_live(FrameSource& source, LiveView& view, FrameTracker& tracker, const LiveRunOptions& options,
                       Preview* preview) {
  fs::create_directories(options.out);
  const OneThreadFewer beside_the_stages;
  LiveRun run(source, view, tracker, options, preview);
  run.run();
  TrackedSequence& tracked = run.result();
  if (tracked.frames.empty()) fail("{} delivered no image", source.name());
  tracked.sequence.name = kName;
  tracked.sequence.last_frame = static_cast<long>(tracked.frames.size()) - 1;
  run.close_file();
  if (tracked.count(FrameState::lost) < static_cast<int>(tracked.frames.size())) {
    make_motion(tracked, RootRotation::of(view.character().skeleton), options.smoothing);
    write_poses(view.character(), tracked_rate(source, run), options.out, tracked);
  } else {
    log::warn("the person was found in none of {} images; there is no motion to write", tracked.frames.size());
  }
  SequenceReport sequence;
  sequence.live = figures_of(source, run);
  tracked.times.pose = 1e-3 * sequence.live->pose_ms * static_cast<double>(tracked.frames.size());
  tracked.times.surface = 1e-3 * sequence.live->surface_ms * static_cast<double>(tracked.frames.size());
  sequence.tracked = std::move(tracked);
  TrackReport report;
  report.method = options.method;
  report.sequences.push_back(std::move(sequence));
  write_atomically(options.out / "track.json", to_json(report).dump(1) + "\n");
  return report;
}

}  // namespace doppel
