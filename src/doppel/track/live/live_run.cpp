#include "doppel/track/live/live_run.h"

#include <algorithm>
#include <atomic>
#include <optional>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/core/process.h"
#include "doppel/track/livecap/surface_file.h"
#include "doppel/track/prefetch.h"
#include "doppel/track/root_rotation.h"
#include "doppel/track/thread_share.h"
#include "doppel/track/tracked_sequence.h"

namespace doppel {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

namespace {

constexpr double kPatience = 0.05;       // seconds that the calling thread waits for a result before it looks around
constexpr double kBetweenReports = 5.0;  // seconds
constexpr char kName[] = "live";
constexpr std::size_t kSettled = 100;  // frames after which all buffers have their size

/// A picture on its way through the stages.
struct SeenPicture {
  SourcePicture source;
  FootageFrame seen;
};

/// What there is to show.
struct Shown {
  cv::Mat picture;
  Eigen::Matrix3Xd vertices;
  LiveState state = LiveState::lost;
};

/// The time that something took, again and again.
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

/// What the stages measure; each figure is written by one stage alone, and read when all have ended.
struct LiveFigures {
  Timing capture, preprocess, detect, pose, surface, latency;
  long behind = 0;                                  ///< pictures that came while a frame was under way, at most
  std::vector<std::pair<long, LiveState>> changes;  ///< picture, and the state from there on
  double settled_megabytes = 0.0;                   ///< of main memory after the first hundred frames
  Clock::time_point first, last;                    ///< of the results
};

class LiveRun {
 public:
  LiveRun(FrameSource& source, LiveView& view, LiveSolver& solver, const LiveRunOptions& options, Preview* preview)
      : source_(source),
        view_(view),
        solver_(solver),
        options_(options),
        preview_(preview),
        pictures_([this] { return take(); }, 1, source.live() ? WhenFull::drop_oldest : WhenFull::wait),
        preprocessed_([this] { return preprocess(); }, 1),
        detected_([this] { return detect(); }, 1),
        solved_([this] { return solve(); }, 1,
                preview && !preview->wants_all() ? WhenFull::drop_oldest : WhenFull::wait) {}

  void run() {
    auto reported = Clock::now();
    while (true) {
      Prefetch<Shown>::Arrival arrival = solved_.next_within(kPatience);
      if (arrival.ended) break;
      const bool goes_on = arrival.thing ? show(*arrival.thing) : !preview_ || preview_->idle();
      if (!goes_on || stop_requested()) pictures_.stop();
      watch_for_silence();
      if (seconds_since(reported) < kBetweenReports) continue;
      reported = Clock::now();
      log::info("{}", caption());
    }
    pictures_.finish();
    if (preview_) preview_->close();
  }

  TrackedSequence& result() { return result_; }
  const LiveFigures& figures() const { return figures_; }
  long num_pictures() const { return came_; }
  long num_dropped() const { return pictures_.num_dropped(); }
  void close_file() {
    if (file_) file_->close();
  }

 private:
  // ---- the stages, each on its thread ----

  std::optional<SourcePicture> take() {
    if (options_.limit_frames > 0 && came_ >= options_.limit_frames) return std::nullopt;
    const auto start = Clock::now();
    std::optional<SourcePicture> picture = source_.next();
    if (!picture) return picture;
    figures_.capture.add(seconds_since(start));
    last_taken_ = picture->taken;
    ++came_;
    return picture;
  }

  std::optional<SeenPicture> preprocess() {
    std::optional<SourcePicture> picture = pictures_.next();
    if (!picture) return std::nullopt;
    const auto start = Clock::now();
    SeenPicture result{std::move(*picture), {}};
    result.seen = view_.preprocess(result.source);
    figures_.preprocess.add(seconds_since(start));
    return result;
  }

  std::optional<SeenPicture> detect() {
    std::optional<SeenPicture> picture = preprocessed_.next();
    if (!picture) return picture;
    const auto start = Clock::now();
    view_.detect(picture->source, picture->seen);
    figures_.detect.add(seconds_since(start));
    return picture;
  }

  std::optional<Shown> solve() {
    std::optional<SeenPicture> picture = detected_.next();
    if (!picture) return std::nullopt;
    if (paused_before(picture->source)) solver_.pause();
    LivecapFrame found = solver_.solve(picture->seen);
    record(picture->source, found);
    return Shown{picture->seen.pictures.front(), std::move(found.vertices), live_state(found.pose.state)};
  }

  bool paused_before(const SourcePicture& picture) {
    const bool first = result_.frames.empty();
    const double gap = std::chrono::duration<double>(picture.taken - solved_at_).count();
    solved_at_ = picture.taken;
    return source_.live() && !first && gap > options_.silence;
  }

  /// Of each frame only what the files need: a live source may go on for hours.
  void record(const SourcePicture& picture, const LivecapFrame& found) {
    const auto now = Clock::now();
    if (result_.frames.empty()) figures_.first = now;
    figures_.last = now;
    figures_.latency.add(std::chrono::duration<double>(now - picture.taken).count());
    figures_.behind = std::max(figures_.behind, came_ - 1 - picture.number);
    figures_.pose.add(found.pose_seconds);
    figures_.surface.add(found.surface_seconds);
    note_state(picture.number, live_state(found.pose.state));
    write_vertices(found);
    TrackedFrame kept;
    kept.dofs = found.pose.dofs;
    kept.state = found.pose.state;
    kept.keypoints = found.pose.keypoints;
    kept.agreeing = found.pose.agreeing;
    kept.keypoint_error = found.pose.keypoint_error;
    kept.iterations = found.pose.iterations;
    result_.frames.push_back(std::move(kept));
    if (result_.frames.size() == kSettled) figures_.settled_megabytes = private_megabytes();
    rate_ = static_cast<double>(result_.frames.size()) /
            std::max(1e-9, std::chrono::duration<double>(now - figures_.first).count());
    latency_ms_ = figures_.latency.mean_ms();
  }

  void note_state(long number, LiveState state) {
    // A frame that was found again is followed from then on.
    const bool goes_on = !figures_.changes.empty() &&
                         (figures_.changes.back().second == state ||
                          (state == LiveState::tracking && figures_.changes.back().second == LiveState::recovered));
    state_ = state;
    if (goes_on) return;
    figures_.changes.emplace_back(number, state);
    log::info("picture {}: {}", number, to_string(state));
  }

  void write_vertices(const LivecapFrame& found) {
    if (!options_.vertices) return;
    if (!file_)
      file_.emplace(options_.out / (std::string(kName) + "_vertices.npy"), view_.character().num_vertices(),
                    options_.filter);
    file_->add(found.vertices, found.pose.state == FrameState::tracked);
  }

  // ---- on the calling thread ----

  bool show(const Shown& shown) {
    if (!preview_) return true;
    return preview_->show(shown.picture, shown.vertices, caption());
  }

  std::string caption() const {
    return fmt::format("{}  {:.1f} frames/s  latency {:.0f} ms  {} dropped", to_string(state_.load()), rate_.load(),
                       latency_ms_.load(), pictures_.num_dropped());
  }

  void watch_for_silence() {
    const bool silent = source_.live() && came_ > 0 && seconds_since(last_taken_) > options_.silence;
    if (silent && !silent_) {
      state_ = LiveState::lost;
      log::warn("{}: no picture for {:.1f} seconds: {}", source_.name(), options_.silence, to_string(LiveState::lost));
    }
    silent_ = silent;
  }

  FrameSource& source_;
  LiveView& view_;
  LiveSolver& solver_;
  const LiveRunOptions& options_;
  Preview* preview_;
  TrackedSequence result_;
  LiveFigures figures_;
  std::optional<SurfaceFile> file_;
  Clock::time_point solved_at_;
  std::atomic<Clock::time_point> last_taken_{Clock::time_point()};
  std::atomic<long> came_{0};
  std::atomic<LiveState> state_{LiveState::lost};
  std::atomic<double> rate_{0.0}, latency_ms_{0.0};
  bool silent_ = false;
  // Last, so that all else is there when their threads begin, and in this order, so that each ends before what it
  // takes from.
  Prefetch<SourcePicture> pictures_;
  Prefetch<SeenPicture> preprocessed_, detected_;
  Prefetch<Shown> solved_;
};

ordered_json figures_json(const FrameSource& source, LiveRun& run) {
  const LiveFigures& figures = run.figures();
  const double seconds = std::chrono::duration<double>(figures.last - figures.first).count();
  const auto results = static_cast<double>(run.result().frames.size());
  ordered_json changes = ordered_json::array();
  for (const auto& [number, state] : figures.changes)
    changes.push_back({{"picture", number}, {"state", to_string(state)}});
  return {{"source", source.name()},
          {"pictures", run.num_pictures()},
          {"dropped", run.num_dropped()},
          {"frames_per_second", seconds > 0.0 ? (results - 1.0) / seconds : 0.0},
          {"latency_ms", {{"mean", figures.latency.mean_ms()}, {"largest", 1e3 * figures.latency.largest}}},
          {"pictures_behind", figures.behind},
          {"milliseconds",
           {{"capture", figures.capture.mean_ms()},
            {"preprocess", figures.preprocess.mean_ms()},
            {"detect", figures.detect.mean_ms()},
            {"pose", figures.pose.mean_ms()},
            {"surface", figures.surface.mean_ms()}}},
          {"memory_mb", {{"after_100_frames", figures.settled_megabytes}, {"at_the_end", private_megabytes()}}},
          {"states", changes}};
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

ordered_json track_live(FrameSource& source, LiveView& view, LiveSolver& solver, const LiveRunOptions& options,
                        Preview* preview) {
  fs::create_directories(options.out);
  const OneThreadFewer beside_the_stages;
  LiveRun run(source, view, solver, options, preview);
  run.run();
  TrackedSequence& tracked = run.result();
  if (tracked.frames.empty()) fail("{} delivered no picture", source.name());
  tracked.sequence.name = kName;
  tracked.sequence.last_frame = static_cast<long>(tracked.frames.size()) - 1;
  tracked.seconds = 1e-3 * (run.figures().pose.mean_ms() + run.figures().surface.mean_ms()) *
                    static_cast<double>(tracked.frames.size());
  run.close_file();
  ordered_json report{{"method", options.method}, {"sequences", ordered_json::object()}};
  ordered_json& entry = report["sequences"][kName] = summary_of(tracked);
  entry["live"] = figures_json(source, run);
  if (tracked.count(FrameState::lost) < static_cast<int>(tracked.frames.size())) {
    make_motion(tracked, RootRotation::of(view.character().skeleton), options.smoothing);
    write_poses(view.character(), source.frames_per_second(), options.out, tracked);
  } else {
    log::warn("the person was found in none of {} pictures; there is no motion to write", tracked.frames.size());
  }
  write_atomically(options.out / "track.json", report.dump(1) + "\n");
  return report;
}

}  // namespace doppel
