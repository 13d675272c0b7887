#include "doppel/calibration/estimation/synchronise.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "doppel/calibration/estimation/epipolar.h"
#include "doppel/calibration/estimation/lag_search.h"
#include "doppel/calibration/estimation/offset_problem.h"
#include "doppel/calibration/estimation/smooth_track.h"
#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/statistics.h"

namespace doppel {
namespace {

constexpr double kMaxJump = 14.0;     // pixels of an image 1024 wide; drop_jumps
constexpr double kMinWidth = 0.03;    // seconds, of the smoothing
constexpr double kGuardFrames = 4.0;  // around the best lag that belong to its minimum
constexpr long kMinOffsetSamples = 60;
constexpr double kScaleOfOffsetMedian = 3.0;
constexpr int kRounds = 6;

void check_options(const PointTracks& tracks, const SynchroniseOptions& options) {
  if (!(options.window >= 1.0 && options.window <= 10000.0))
    fail<UsageError>("synchronising: the window is {} frames; it must be from 1 to 10000", options.window);
  if (options.reference < 0 || options.reference >= tracks.num_cameras())
    fail<UsageError>("synchronising: the reference is camera {}; there are {} cameras, counted from 0",
                     options.reference, tracks.num_cameras());
  if (!(options.kernel > 0.0) || options.most_times < 2)
    fail<UsageError>("synchronising: the kernel ({}) must be positive and the number of times ({}) at least 2",
                     options.kernel, options.most_times);
}

double slowest_rate(const PointTracks& tracks) {
  double slowest = std::numeric_limits<double>::infinity();
  for (const CameraTrack& track : tracks.cameras) slowest = std::min(slowest, track.fps);
  return slowest;
}

/// The tracks without distortion and without jumps.
PointTracks cleaned(const std::vector<Camera>& cameras, const PointTracks& tracks) {
  PointTracks clean = straight_tracks(cameras, tracks);
  drop_unusable(clean, 0.0);
  for (std::size_t c = 0; c < cameras.size(); ++c) drop_jumps(clean.cameras[c], kMaxJump * cameras[c].width / 1024.0);
  return clean;
}

std::vector<FoundLag> whole_lags(const std::vector<Camera>& cameras, const PointTracks& clean, double width,
                                 const SynchroniseOptions& options) {
  PointTracks smooth = clean;
  for (CameraTrack& track : smooth.cameras) track = smooth_track(track, width * track.fps);
  const double frame = 1.0 / slowest_rate(clean);
  LagSearchOptions search;
  search.step = 0.5 * frame;
  search.steps = static_cast<int>(std::ceil(options.window * frame / search.step));
  search.guard = static_cast<int>(std::lround(kGuardFrames * frame / search.step));
  search.kernel = options.kernel;
  search.reference = options.reference;
  return search_lags(cameras, smooth, search);
}

/// The median distance of each camera's pairs, averaged over its pairs; the last entry is of all pairs.
std::vector<double> agreements(const std::vector<Camera>& cameras, const PointTracks& tracks, std::size_t most) {
  std::vector<double> sums(cameras.size() + 1, 0.0), counts(cameras.size() + 1, 0.0);
  for (const EpipolarAgreement& pair : epipolar_agreement(cameras, tracks, tracks.times(most)))
    for (const std::size_t at : {as_size(pair.a), as_size(pair.b), cameras.size()}) {
      sums[at] += static_cast<double>(pair.samples) * pair.median;
      counts[at] += static_cast<double>(pair.samples);
    }
  for (std::size_t i = 0; i < sums.size(); ++i) sums[i] = counts[i] > 0.0 ? sums[i] / counts[i] : 0.0;
  return sums;
}

/// The tracks with two more points for each pair: its frontier points, seen by its cameras alone. The pixel of a
/// frontier point depends on the outline of its own camera only, so frontier points have tracks like points.
PointTracks with_tangents(const std::vector<Camera>& cameras, const PointTracks& clean,
                          const std::vector<std::pair<int, int>>& pairs, const std::vector<OutlineTrack>& outlines) {
  PointTracks result = clean;
  result.points.resize(result.points.size() + 2 * pairs.size());
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const CameraTrack& old = clean.cameras[c];
    CameraTrack track(old.name, old.fps, old.num_frames(), result.num_points());
    track.offset = old.offset;
    for (long frame = 0; frame < old.num_frames(); ++frame)
      for (int k = 0; k < old.num_points(); ++k) track.at(frame, k) = old.at(frame, k);
    result.cameras[c] = std::move(track);
  }
  int point = clean.num_points();
  for (const auto& [a, b] : pairs) {
    const FrontierFinder finder(cameras[a], cameras[b]);
    for (const int side : {0, 1}) {
      for (const auto& [which, c] : {std::pair{0, as_size(a)}, {1, as_size(b)}})
        for (long frame = 0; frame < result.cameras[c].num_frames(); ++frame) {
          const auto pixel = finder.find(which, outlines[c], static_cast<double>(frame), side);
          const auto straight = pixel ? straight_pixel(cameras[c], *pixel) : std::nullopt;
          if (straight) result.cameras[c].at(frame, point) = {*straight, 1.0};
        }
      ++point;
    }
  }
  return result;
}

/// Fractions of a frame for the cameras whose lag was found.
void refine(const std::vector<Camera>& cameras, const PointTracks& clean, double width,
            const SynchroniseOptions& options, const std::vector<OutlineTrack>& outlines,
            std::vector<CameraTiming>& timings) {
  const std::vector<std::pair<int, int>> pairs = pairs_to_compare(cameras);
  OffsetProblemOptions of_problem{options.reference, options.drift, width};
  if (!outlines.empty()) of_problem.first_tangent = clean.num_points();
  OffsetProblem problem(cameras, outlines.empty() ? clean : with_tangents(cameras, clean, pairs, outlines), pairs,
                        clean.times(options.most_times), of_problem);
  Eigen::VectorXd state = Eigen::VectorXd::Zero(problem.num_unknowns());
  for (int round = 0; round < kRounds; ++round) {
    problem.begin_round(state, options.kernel, kScaleOfOffsetMedian);
    SolverOptions solver;
    solver.iterations = 60;
    solver.function_tolerance = 1e-10;
    solver.parameter_tolerance = 1e-9;
    minimise(problem, state, solver);
  }
  problem.begin_round(state, options.kernel, kScaleOfOffsetMedian);
  const Eigen::MatrixXd covariance = problem.covariance(state);
  const std::vector<long> samples = problem.samples();
  for (std::size_t c = 0; c < timings.size(); ++c) {
    CameraTiming& timing = timings[c];
    const CameraTrack& track = clean.cameras[c];
    const int index = problem.offset_index(static_cast<int>(c));
    if (index < 0) continue;
    const double rate = options.drift ? state[index + 1] : 0.0;
    timing.fps = track.fps * (1.0 + rate);
    timing.offset = track.offset + track.fps * (state[index] - rate * problem.middle());
    double variance = covariance(index, index);
    if (options.drift) {
      const double of_rate = covariance(index + 1, index + 1), arm = problem.middle();
      variance += arm * arm * of_rate - 2.0 * arm * covariance(index, index + 1);
      timing.fps_sigma = track.fps * std::sqrt(std::max(0.0, of_rate));
    }
    timing.sigma = track.fps * std::sqrt(std::max(0.0, variance));
    if (samples[c] < kMinOffsetSamples || !std::isfinite(timing.sigma) || timing.sigma == 0.0)
      timing.sigma = std::numeric_limits<double>::infinity();
  }
}

/// Whether the offset can be told, and why not.
std::string doubt(const CameraTiming& timing, bool reached, double largest_change, const SynchroniseOptions& options) {
  if (!reached) return "the camera shares too few points with the others";
  if (timing.contrast < options.smallest_contrast)
    return fmt::format(
        "other offsets explain the points almost as well (contrast {:.2f}, needed {:.2f}); the person moves too little",
        timing.contrast, options.smallest_contrast);
  if (!(timing.sigma <= options.largest_sigma))
    return fmt::format(
        "the standard deviation is {:.2f} frames (allowed {:.2f}); the person moves too little, or only along the "
        "epipolar lines",
        timing.sigma, options.largest_sigma);
  if (std::abs(timing.change) > largest_change)
    return fmt::format("the best offset lies at the end of the window of {:g} frames; widen the window",
                       options.window);
  return {};
}

}  // namespace

Synchronisation synchronise(const std::vector<Camera>& cameras, const PointTracks& tracks,
                            const SynchroniseOptions& options, const std::vector<OutlineTrack>& outlines) {
  check_tracks(cameras, tracks, 2, "synchronising");
  check_options(tracks, options);
  check_outlines(cameras, outlines, "synchronising");
  PointTracks clean = cleaned(cameras, tracks);
  const double slowest = slowest_rate(tracks), width = std::max(kMinWidth, 1.0 / slowest);
  const std::vector<FoundLag> lags = whole_lags(cameras, clean, width, options);
  Synchronisation result;
  result.reference = options.reference;
  for (std::size_t c = 0; c < lags.size(); ++c) {
    CameraTrack& track = clean.cameras[c];
    track.offset += lags[c].step * 0.5 * track.fps / slowest;
    CameraTiming timing;
    timing.name = track.name;
    timing.fps = track.fps;
    timing.offset = track.offset;
    timing.contrast = lags[c].contrast;
    result.cameras.push_back(timing);
  }
  refine(cameras, clean, width, options, outlines, result.cameras);
  for (std::size_t c = 0; c < lags.size(); ++c) {
    CameraTiming& timing = result.cameras[c];
    const CameraTrack& old = tracks.cameras[c];
    timing.change = timing.offset - old.offset;
    const double largest_change = (options.window - 0.4) * old.fps / slowest;
    const bool is_reference = static_cast<int>(c) == options.reference;
    timing.reason = is_reference ? "" : doubt(timing, lags[c].reached, largest_change, options);
    timing.known = timing.reason.empty();
    if (!timing.known) {
      timing.offset = old.offset;
      timing.fps = old.fps;
      timing.change = timing.fps_sigma = 0.0;
    }
  }
  PointTracks timed = tracks;
  apply(result, timed);
  const std::vector<double> before = agreements(cameras, tracks, options.most_times);
  const std::vector<double> after = agreements(cameras, timed, options.most_times);
  for (std::size_t c = 0; c < lags.size(); ++c) {
    result.cameras[c].before = before[c];
    result.cameras[c].after = after[c];
  }
  result.before = before.back();
  result.after = after.back();
  return result;
}

void apply(const Synchronisation& timing, PointTracks& tracks) {
  for (std::size_t c = 0; c < timing.cameras.size(); ++c) {
    if (!timing.cameras[c].known) continue;
    tracks.cameras[c].offset = timing.cameras[c].offset;
    tracks.cameras[c].fps = timing.cameras[c].fps;
  }
}

}  // namespace doppel
