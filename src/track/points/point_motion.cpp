#include "doppel/track/points/point_motion.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/geometry/triangulation.h"
#include "doppel/track/fit/pose_sequence.h"

namespace doppel {

namespace {

constexpr double kReferenceSide = 1024.0;
constexpr double kMaxResidual = 2.5;  // of a view that counts at all, in units of `kernel`
constexpr int kRefinementSteps = 12;
constexpr int kParabola = 2;

/// Triangulates the points of one row after the other.
class Triangulator {
 public:
  Triangulator(const PointTracks& tracks, const std::vector<Camera>& cameras, const PointMotionOptions& options)
      : tracks_(tracks), cameras_(cameras), options_(options), last_(as_size(tracks.num_points())) {
    triangulation_.inlier_threshold = kMaxResidual * options.kernel;
    triangulation_.kernel = options.kernel;
    triangulation_.refinement_steps = kRefinementSteps;
    for (const Camera& camera : cameras) {
      report_.push_back({camera.name, 0, 0, 0.0});
      scale_.push_back(kReferenceSide / std::max(camera.width, camera.height));
    }
  }

  /// @param times [C] in frames of each camera
  PointMotion::Frame row(const std::vector<double>& times) {
    PointMotion::Frame frame(as_size(tracks_.num_points()));
    for (int k = 0; k < tracks_.num_points(); ++k) frame[k] = point(k, times);
    return frame;
  }

  std::vector<PointCamera> report() const {
    std::vector<PointCamera> cameras = report_;
    for (PointCamera& camera : cameras)
      camera.residual_px /= static_cast<double>(std::max(1L, camera.agreeing));  // was the sum
    return cameras;
  }

 private:
  std::optional<Eigen::Vector3d> point(int k, const std::vector<double>& times) {
    std::vector<Sight> sights;
    std::vector<std::size_t> views;
    for (std::size_t c = 0; c < cameras_.size(); ++c) {
      const TrackPoint seen = tracks_.cameras[c].sample(times[c], k);
      if (seen.confidence < options_.min_confidence) continue;
      std::optional<Sight> sight = sight_of(cameras_[c], seen.pixel, seen.confidence);
      if (!sight) continue;
      sight->unit_from_plane *= scale_[c];
      sights.push_back(*sight);
      views.push_back(c);
    }
    const std::optional<TriangulatedPoint> found = choose(sights, as_size(k));
    if (!found) return std::nullopt;
    last_[k] = found->position;
    for (std::size_t i = 0; i < views.size(); ++i) count(views[i], *found, i);
    return found->position;
  }

  /// Where the agreeing cameras are no majority and the others agree on another point, the point nearer to the last
  /// position is taken: a detector may confuse left and right for some frames in half of the cameras.
  std::optional<TriangulatedPoint> choose(const std::vector<Sight>& sights, std::size_t k) const {
    const std::optional<TriangulatedPoint> first = point_of(sights);
    if (!first || !last_[k] || 2 * agreeing_views(*first) > sights.size()) return first;
    std::vector<Sight> others;
    for (std::size_t i = 0; i < sights.size(); ++i)
      if (!agrees(*first, i)) others.push_back(sights[i]);
    const std::optional<TriangulatedPoint> second = point_of(others);
    if (!second || (second->position - *last_[k]).norm() >= (first->position - *last_[k]).norm()) return first;
    return with_residuals(*second, sights);
  }

  std::optional<TriangulatedPoint> point_of(const std::vector<Sight>& sights) const {
    if (sights.size() < 2) return std::nullopt;
    const std::optional<TriangulatedPoint> point = triangulate(sights, triangulation_);
    return point && agreeing_views(*point) >= 2 ? point : std::nullopt;
  }

  bool agrees(const TriangulatedPoint& point, std::size_t sight) const {
    return point.residuals[sight] <= options_.max_residual;
  }
  std::size_t agreeing_views(const TriangulatedPoint& point) const {
    std::size_t views = 0;
    for (std::size_t i = 0; i < point.residuals.size(); ++i) views += agrees(point, i) ? 1 : 0;
    return views;
  }

  /// The same point with its residuals in all sights.
  static TriangulatedPoint with_residuals(TriangulatedPoint point, const std::vector<Sight>& sights) {
    point.residuals.clear();
    for (const Sight& sight : sights) {
      const std::optional<Eigen::Vector2d> residual = residual_of(sight, point.position);
      point.residuals.push_back(residual ? residual->norm() : std::numeric_limits<double>::infinity());
    }
    return point;
  }

  void count(std::size_t c, const TriangulatedPoint& found, std::size_t sight) {
    ++report_[c].seen;
    if (!agrees(found, sight)) return;
    ++report_[c].agreeing;
    report_[c].residual_px += found.residuals[sight] / scale_[c];
  }

  const PointTracks& tracks_;
  const std::vector<Camera>& cameras_;
  const PointMotionOptions& options_;
  TriangulationOptions triangulation_;
  std::vector<PointCamera> report_;
  std::vector<double> scale_;                         ///< [C] reference pixels per pixel as filmed
  std::vector<std::optional<Eigen::Vector3d>> last_;  ///< [K] last position found
};

/// Frames of one point without a gap and without a cut inside.
struct Run {
  std::size_t begin = 0, end = 0;
};

std::vector<Run> runs_of(const PointMotion& motion, std::size_t point, const std::vector<long>& cuts) {
  std::vector<Run> runs;
  for (std::size_t f = 0; f < motion.frames.size(); ++f) {
    if (!motion.frames[f][point]) continue;
    const bool is_cut = std::find(cuts.begin(), cuts.end(), static_cast<long>(f)) != cuts.end();
    if (!runs.empty() && runs.back().end == f && !is_cut)
      ++runs.back().end;
    else
      runs.push_back({f, f + 1});
  }
  return runs;
}

bool is_cut_between(const Run& before, const Run& after, const std::vector<long>& cuts) {
  return std::any_of(cuts.begin(), cuts.end(),
                     [&](long cut) { return as_size(cut) >= before.end && as_size(cut) <= after.begin; });
}

void fill(PointMotion& motion, std::size_t point, const std::vector<long>& cuts, std::size_t longest) {
  const std::vector<Run> runs = runs_of(motion, point, cuts);
  for (std::size_t i = 1; i < runs.size(); ++i) {
    const std::size_t begin = runs[i - 1].end, end = runs[i].begin;
    if (begin == end || end - begin > longest || is_cut_between(runs[i - 1], runs[i], cuts)) continue;
    const Eigen::Vector3d before = *motion.frames[begin - 1][point], after = *motion.frames[end][point];
    for (std::size_t f = begin; f < end; ++f) {
      const double share = static_cast<double>(f - begin + 1) / static_cast<double>(end - begin + 1);
      motion.frames[f][point] = Eigen::Vector3d(before + share * (after - before));
      ++motion.filled;
    }
  }
}

void smooth(PointMotion& motion, std::size_t point, const Run& run, double sigma) {
  std::vector<std::vector<double>> values;
  for (std::size_t f = run.begin; f < run.end; ++f) {
    const Eigen::Vector3d& position = *motion.frames[f][point];
    values.push_back({position.x(), position.y(), position.z()});
  }
  smooth_poses(values, {}, std::nullopt, sigma, kParabola);
  for (std::size_t f = run.begin; f < run.end; ++f)
    motion.frames[f][point] = Eigen::Vector3d::Map(values[f - run.begin].data());
}

}  // namespace

double PointMotion::found() const {
  long found = 0;
  for (const Frame& frame : frames) found += std::count_if(frame.begin(), frame.end(), [](const auto& p) { return p; });
  const auto all = static_cast<double>(frames.size() * points.size());
  return all > 0.0 ? static_cast<double>(found) / all : 0.0;
}

PointMotion triangulate_tracks(const PointTracks& tracks, const std::vector<Camera>& cameras,
                               const std::vector<FrameClock>& clocks, double fps, long first_row, long last_row,
                               const PointMotionOptions& options) {
  if (tracks.cameras.size() != cameras.size() || clocks.size() != cameras.size())
    fail("points of {} cameras cannot be triangulated with {} calibrated cameras and {} clocks", tracks.cameras.size(),
         cameras.size(), clocks.size());
  PointMotion motion;
  motion.points = tracks.points;
  motion.fps = fps;
  motion.first_row = first_row;
  Triangulator triangulator(tracks, cameras, options);
  for (long row = first_row; row <= last_row; ++row) {
    std::vector<double> times;
    for (const FrameClock& clock : clocks) times.push_back(clock.time(row));
    motion.frames.push_back(triangulator.row(times));
  }
  motion.cameras = triangulator.report();
  return motion;
}

void fill_and_smooth(PointMotion& motion, const std::vector<long>& cuts, const PointMotionOptions& options) {
  const auto longest = as_size(std::floor(options.longest_gap * motion.fps));
  for (std::size_t k = 0; k < motion.points.size(); ++k) {
    fill(motion, k, cuts, longest);
    for (const Run& run : runs_of(motion, k, cuts)) smooth(motion, k, run, options.smoothing * motion.fps);
  }
}

}  // namespace doppel
