#include "doppel/calibration/estimation/find_moved_cameras.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>

#include "doppel/calibration/estimation/fit_pose.h"
#include "doppel/calibration/estimation/reprojection.h"
#include "doppel/core/as_size.h"
#include "doppel/core/statistics.h"

namespace doppel {
namespace {

using Eigen::Vector2d;

constexpr std::size_t kMinTimes = 20;
constexpr double kMinKernel = 2.5;  // pixels of an image 1024 wide
constexpr double kKernelOfMedian = 3.0;
constexpr int kSplitRounds = 4;
constexpr std::size_t kTimesBesideSplit = 12;  // that must show the jump
constexpr std::size_t kMinPosePoints = 30;     // points
constexpr std::size_t kMaxTimesOfMove = 300;   // times; more are thinned out
constexpr double kMinGain = 0.5;               // share of the robust cost that a second pose must save
constexpr double kMinMove = 1.5;   // pixels of an image 1024 wide by which the median point must have jumped
constexpr double kMinPart = 0.08;  // share of the recording before and after the move

using Signature = Eigen::Vector4d;  // of one time: shift, turn and growth of the image, pixels

/// What one camera saw of points that the other cameras see in space.
struct CameraSightings {
  std::vector<double> times;
  std::vector<std::vector<PointSighting>> points;  ///< [T]

  std::vector<PointSighting> between(std::size_t first, std::size_t last) const {
    std::vector<PointSighting> joined;
    for (std::size_t t = first; t < last; ++t) joined.insert(joined.end(), points[t].begin(), points[t].end());
    return joined;
  }
};

CameraSightings sightings_of(const std::vector<Camera>& cameras, const PointTracks& tracks,
                             const std::vector<bool>& trusted, int camera, const std::vector<double>& times) {
  CameraSightings result;
  for (const double time : times) {
    std::vector<PointSighting> found;
    for (int k = 0; k < tracks.num_points(); ++k) {
      const CameraTrack& track = tracks.cameras[camera];
      const TrackPoint seen = track.sample(track.frame_at(time), k);
      if (!seen.seen()) continue;
      std::vector<SeenFrom> others = seen_at(tracks, time, k);
      std::erase_if(others, [&](const SeenFrom& view) { return view.camera == camera || !trusted[view.camera]; });
      const auto point = triangulate(cameras, others, {});
      if (point) found.push_back({point->position, seen.pixel});
    }
    if (found.empty()) continue;
    result.times.push_back(time);
    result.points.push_back(std::move(found));
  }
  return result;
}

/// The robust cost of each time.
std::vector<double> costs_of(const Camera& camera, const CameraSightings& seen, double kernel) {
  std::vector<double> costs;
  for (const std::vector<PointSighting>& points : seen.points) costs.push_back(pose_cost(camera, points, kernel));
  return costs;
}

/// How the image of one time is shifted, turned and grown against the projected points.
Signature signature_of(const Camera& camera, const std::vector<PointSighting>& points) {
  std::vector<double> x, y;
  std::vector<Vector2d> from, residuals;
  Vector2d middle = Vector2d::Zero();
  for (const PointSighting& seen : points) {
    from.push_back(camera.project(seen.point));
    residuals.push_back(seen.pixel - from.back());
    x.push_back(residuals.back().x());
    y.push_back(residuals.back().y());
    middle += from.back() / static_cast<double>(points.size());
  }
  const Vector2d shift(quantile(x, 0.5), quantile(y, 0.5));
  std::vector<double> turns, growths;
  for (std::size_t i = 0; i < from.size(); ++i) {
    const Vector2d arm = from[i] - middle, rest = residuals[i] - shift;
    const double length = arm.norm();
    if (!(length > 1.0)) continue;
    turns.push_back((arm.x() * rest.y() - arm.y() * rest.x()) / length);
    growths.push_back(arm.dot(rest) / length);
  }
  return {shift.x(), shift.y(), quantile(turns, 0.5), quantile(growths, 0.5)};
}

/// The time before which and from which on two constant signatures fit best.
std::size_t first_split(const Camera& camera, const CameraSightings& seen, std::size_t shortest) {
  std::vector<Signature> sums{Signature::Zero()};
  for (const std::vector<PointSighting>& points : seen.points)
    sums.push_back(sums.back() + signature_of(camera, points));
  const std::size_t count = seen.points.size();
  std::size_t best = shortest;
  double most = -1.0;
  for (std::size_t split = shortest; split + shortest <= count; ++split) {
    const auto before = static_cast<double>(split), after = static_cast<double>(count - split);
    const Signature difference = sums[split] / before - (sums[count] - sums[split]) / after;
    const double gain = difference.squaredNorm() * before * after;
    if (gain <= most) continue;
    most = gain;
    best = split;
  }
  return best;
}

/// The best split for two given poses. @param sigma standard deviation of the split, times
std::size_t best_split(const std::vector<double>& before, const std::vector<double>& after, std::size_t shortest,
                       double noise, double* sigma = nullptr) {
  std::vector<double> costs(before.size() + 1, 0.0);
  for (std::size_t t = 0; t < after.size(); ++t) costs[0] += after[t];
  for (std::size_t t = 0; t < before.size(); ++t) costs[t + 1] = costs[t] + before[t] - after[t];
  const auto first = costs.begin() + static_cast<std::ptrdiff_t>(shortest);
  const auto last = costs.end() - static_cast<std::ptrdiff_t>(shortest);
  const auto best = std::min_element(first, last);
  if (sigma != nullptr) {
    double sum = 0.0, moment = 0.0;
    for (auto cost = first; cost != last; ++cost) {
      const double likelihood = std::exp(-(*cost - *best) / (2.0 * noise)), apart = static_cast<double>(cost - best);
      sum += likelihood;
      moment += likelihood * apart * apart;
    }
    *sigma = std::sqrt(moment / sum + 1.0 / 12.0);
  }
  return as_size(best - costs.begin());
}

double sum_of(const std::vector<double>& values, std::size_t first, std::size_t last) {
  double sum = 0.0;
  for (std::size_t i = first; i < last; ++i) sum += values[i];
  return sum;
}

/// The move of one camera, whether or not it is large enough.
class MoveOfCamera {
 public:
  MoveOfCamera(Camera camera, CameraSightings seen) : camera_(std::move(camera)), seen_(std::move(seen)) {
    shortest_ = std::max<std::size_t>(3, as_size(kMinPart * static_cast<double>(seen_.times.size())));
  }

  /// @return false when there are too few points
  bool fit() {
    const std::size_t count = seen_.times.size();
    if (count < std::max(kMinTimes, 2 * shortest_ + 1)) return false;
    const std::vector<PointSighting> all = seen_.between(0, count);
    kernel_ = std::max(kMinKernel, kKernelOfMedian * median_residual(camera_, all));
    one_ = fit_pose(camera_, all, kernel_);
    split_ = first_split(one_, seen_, shortest_);
    before_ = after_ = one_;
    for (int round = 0; round < kSplitRounds; ++round) {
      const std::vector<PointSighting> early = seen_.between(0, split_), late = seen_.between(split_, count);
      if (std::min(early.size(), late.size()) < kMinPosePoints) return false;
      before_ = fit_pose(before_, early, kernel_);
      after_ = fit_pose(after_, late, kernel_);
      // With two poses the residuals are those of the detector; its kernel no longer bears the move.
      std::vector<PointSighting> first = early;
      const double median = std::max(median_residual(before_, first), median_residual(after_, late));
      kernel_ = std::max(kMinKernel, std::min(kernel_, kKernelOfMedian * median));
      cost_before_ = costs_of(before_, seen_, kernel_);
      cost_after_ = costs_of(after_, seen_, kernel_);
      const std::size_t better = best_split(cost_before_, cost_after_, shortest_, 1.0);
      if (better == split_ && round > 0) break;
      split_ = better;
    }
    return true;
  }

  /// The share of the cost beside the split that the right order of the poses saves over the wrong order.
  double local_gain() const {
    const std::size_t first = split_ - std::min(split_, kTimesBesideSplit);
    const std::size_t last = std::min(seen_.times.size(), split_ + kTimesBesideSplit);
    const double right = sum_of(cost_before_, first, split_) + sum_of(cost_after_, split_, last);
    const double wrong = sum_of(cost_after_, first, split_) + sum_of(cost_before_, split_, last);
    return wrong > 0.0 ? 1.0 - right / wrong : 0.0;
  }

  /// The share of the cost with one pose that the two poses save.
  double gain() const {
    const std::size_t count = seen_.times.size();
    const std::vector<double> one = costs_of(fit_pose(one_, seen_.between(0, count), kernel_), seen_, kernel_);
    const double two = sum_of(cost_before_, 0, split_) + sum_of(cost_after_, split_, count);
    const double alone = sum_of(one, 0, count);
    return alone > 0.0 ? 1.0 - two / alone : 0.0;
  }

  /// By how many pixels the median point jumped.
  double jump() const {
    std::vector<double> lengths;
    for (const std::vector<PointSighting>& points : seen_.points)
      for (const PointSighting& seen : points)
        lengths.push_back((before_.project(seen.point) - after_.project(seen.point)).norm());
    return quantile(lengths, 0.5);
  }

  MovedCamera report(int index, const CameraTrack& track, const CameraSightings& fine) const {
    MovedCamera moved;
    moved.camera = index;
    moved.name = track.name;
    const std::vector<double> before = costs_of(before_, fine, kernel_), after = costs_of(after_, fine, kernel_);
    double sigma = 0.0;
    const std::size_t split = best_split(before, after, 1, kernel_ * kernel_ / 9.0, &sigma);
    moved.seconds = 0.5 * (fine.times[split - 1] + fine.times[split]);
    moved.frame = track.frame_at(moved.seconds);
    const double step = (fine.times.back() - fine.times.front()) / static_cast<double>(fine.times.size() - 1);
    moved.frame_sigma = sigma * step * track.fps;
    moved.jump = jump();
    moved.before = before_;
    moved.after = after_;
    moved.rotation = Eigen::AngleAxisd(after_.R * before_.R.transpose()).angle();
    moved.shift = (after_.centre() - before_.centre()).norm();
    return moved;
  }

  /// The times beside the split between which the move is looked for frame by frame.
  std::pair<double, double> neighbourhood() const {
    const std::size_t first = split_ - std::min(split_, std::size_t{3});
    return {seen_.times[first], seen_.times[std::min(seen_.times.size() - 1, split_ + 3)]};
  }

 private:
  Camera camera_, one_, before_, after_;
  CameraSightings seen_;
  std::size_t shortest_ = 3, split_ = 0;
  double kernel_ = kMinKernel;
  std::vector<double> cost_before_, cost_after_;
};

}  // namespace

std::vector<MovedCamera> find_moved_cameras(const std::vector<Camera>& cameras, const PointTracks& tracks) {
  check_tracks(cameras, tracks, 3, "looking for moved cameras");
  PointTracks usable = tracks;
  drop_unusable(usable, 0.0);
  const std::vector<double> times = usable.times(kMaxTimesOfMove), every = usable.times();
  std::vector<bool> trusted(cameras.size(), true);
  std::vector<MovedCamera> found;
  while (std::count(trusted.begin(), trusted.end(), true) >= 3) {
    std::optional<MovedCamera> clearest;
    double most = 0.0;
    for (int c = 0; c < usable.num_cameras(); ++c) {
      if (!trusted[c]) continue;
      const Camera& camera = cameras[c];
      MoveOfCamera move(camera, sightings_of(cameras, usable, trusted, c, times));
      if (!move.fit() || move.jump() * rig_reference_pixels(camera) < kMinMove) continue;
      const double gain = std::min(move.gain(), move.local_gain());
      if (gain < kMinGain || gain <= most) continue;
      std::vector<double> near;
      for (const double time : every)
        if (time >= move.neighbourhood().first && time <= move.neighbourhood().second) near.push_back(time);
      const CameraSightings fine = sightings_of(cameras, usable, trusted, c, near);
      if (fine.times.size() < 2) continue;
      most = gain;
      clearest = move.report(c, usable.cameras[c], fine);
    }
    if (!clearest) break;
    trusted[clearest->camera] = false;
    found.push_back(*clearest);
  }
  std::sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.seconds < b.seconds; });
  return found;
}

}  // namespace doppel
