#include "doppel/calibration/estimation/lag_search.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "doppel/calibration/estimation/epipolar.h"
#include "doppel/core/as_size.h"
#include "doppel/core/statistics.h"
#include "doppel/solver/residuals.h"

namespace doppel {
namespace {

constexpr double kMaxFrames = 160.0;  // of one camera that are compared at each lag
constexpr double kMinOverlap = 0.35;  // of the samples at the lag with the most
constexpr double kMinLagSamples = 30.0;
constexpr int kCoarse = 4;  // every fourth lag is looked at for the kernel's scale
constexpr double kScaleOfLagMedian = 2.0;
constexpr double kRoughCalibration = 8.0;  // pixels of an image 1024 wide
constexpr int kSweeps = 3;

/// The signed distances of a pair at one lag, pixels of an image 1024 wide.
class PairAtLags {
 public:
  PairAtLags(const std::vector<Camera>& cameras, const PointTracks& tracks, int a, int b)
      : pair_(cameras[a], cameras[b]),
        in_a_(tracks.cameras[a]),
        in_b_(tracks.cameras[b]),
        scale_(2048.0 / (cameras[a].width + cameras[b].width)) {
    const double first = in_a_.frame_at(in_b_.seconds_at(0.0));
    const double last = in_a_.frame_at(in_b_.seconds_at(static_cast<double>(in_b_.num_frames() - 1)));
    first_ = std::max(0L, static_cast<long>(std::floor(first)));
    last_ = std::min(in_a_.num_frames() - 1, static_cast<long>(std::ceil(last)));
  }

  std::vector<double> at(double lag) const {
    const auto reach = static_cast<long>(std::abs(lag) * in_a_.fps) + 1;
    const long first = std::max(0L, first_ - reach), last = std::min(in_a_.num_frames() - 1, last_ + reach);
    const long stride = std::max(1L, std::lround(static_cast<double>(last_ - first_ + 1) / kMaxFrames));
    std::vector<double> found;
    for (long frame = first; frame <= last; frame += stride) {
      const double other = in_b_.frame_at(in_a_.seconds_at(static_cast<double>(frame)) + lag);
      for (int k = 0; k < in_a_.num_points(); ++k) {
        const TrackPoint& p = in_a_.at(frame, k);
        if (!p.seen()) continue;
        const TrackPoint q = in_b_.sample(other, k);
        if (!q.seen()) continue;
        const double distance = scale_ * pair_.distance(p.pixel, q.pixel);
        if (std::isfinite(distance)) found.push_back(distance);
      }
    }
    return found;
  }

 private:
  EpipolarPair pair_;
  const CameraTrack &in_a_, &in_b_;
  double scale_;
  long first_ = 0, last_ = 0;
};

/// The absolute distances. @param unbiased after their median is subtracted
std::vector<double> sizes_of(std::vector<double> distances, bool unbiased) {
  const double middle = unbiased ? quantile(distances, 0.5) : 0.0;
  for (double& distance : distances) distance = std::abs(distance - middle);
  return distances;
}

/// The smallest median distance over the lags; infinite when no lag has samples enough.
double least_median(const PairAtLags& pair, int reach, double step, bool unbiased) {
  double least = std::numeric_limits<double>::infinity(), most = 0.0;
  for (int i = -reach; i <= reach; i += kCoarse) {
    const std::vector<double> distances = sizes_of(pair.at(i * step), unbiased);
    most = std::max(most, static_cast<double>(distances.size()));
    if (static_cast<double>(distances.size()) < std::max(kMinLagSamples, kMinOverlap * most)) continue;
    least = std::min(least, quantile(distances, 0.5));
  }
  return least;
}

LagCurve curve_of(const std::vector<Camera>& cameras, const PointTracks& tracks, int a, int b,
                  const LagSearchOptions& options) {
  const PairAtLags pair(cameras, tracks, a, b);
  const bool has_reference = a == options.reference || b == options.reference;
  const int reach = has_reference ? options.steps : 2 * options.steps;
  LagCurve curve{a, b, std::vector<double>(2 * reach + 1, 1.0), 0.0, options.kernel};
  double least = least_median(pair, reach, options.step, false);
  if (!std::isfinite(least)) return curve;
  // A calibration that is a degree or more off moves all points off their lines, and more than the lag does.
  const bool unbiased = least > kRoughCalibration;
  if (unbiased) least = least_median(pair, reach, options.step, true);
  curve.scale = std::max(options.kernel, kScaleOfLagMedian * least);
  const RobustKernel kernel = RobustKernel::geman_mcclure_of(curve.scale);
  std::vector<double> counts(curve.costs.size());
  for (int i = -reach; i <= reach; ++i) {
    const std::vector<double> distances = sizes_of(pair.at(i * options.step), unbiased);
    double sum = 0.0;
    for (const double distance : distances) sum += kernel.cost(distance * distance);
    counts[i + reach] = static_cast<double>(distances.size());
    if (!distances.empty())
      curve.costs[i + reach] = sum / (curve.scale * curve.scale * static_cast<double>(distances.size()));
  }
  curve.samples = *std::max_element(counts.begin(), counts.end());
  for (std::size_t i = 0; i < counts.size(); ++i)
    if (counts[i] < std::max(kMinLagSamples, kMinOverlap * curve.samples)) curve.costs[i] = 1.0;
  return curve;
}

/// Adds cameras by the curves of their pairs.
class LagGraph {
 public:
  LagGraph(int cameras, std::vector<LagCurve> curves, const LagSearchOptions& options)
      : curves_(std::move(curves)), options_(options), found_(as_size(cameras)) {}

  std::vector<FoundLag> solve() {
    found_[options_.reference].reached = true;
    while (add_clearest()) {
    }
    for (int sweep = 0; sweep < kSweeps; ++sweep)
      for (int c = 0; c < static_cast<int>(found_.size()); ++c)
        if (c != options_.reference && found_[c].reached) found_[c] = *best_of(c);
    return found_;
  }

 private:
  bool add_clearest() {
    int clearest = -1;
    FoundLag best;
    for (int c = 0; c < static_cast<int>(found_.size()); ++c) {
      if (found_[c].reached) continue;
      const auto found = best_of(c);
      if (found && (clearest < 0 || found->contrast > best.contrast)) {
        clearest = c;
        best = *found;
      }
    }
    if (clearest >= 0) found_[clearest] = best;
    return clearest >= 0;
  }

  /// The lag with the lowest cost over the pairs of a camera with cameras that were placed.
  std::optional<FoundLag> best_of(int camera) const {
    std::vector<double> sums(2 * options_.steps + 1, 0.0);
    double samples = 0.0;
    for (const LagCurve& curve : curves_) {
      if ((curve.a != camera && curve.b != camera) || curve.samples < kMinLagSamples) continue;
      const int other = curve.a == camera ? curve.b : curve.a;
      if (!found_[other].reached) continue;
      samples += curve.samples;
      const auto reach = static_cast<int>(curve.costs.size() / 2);
      for (int i = -options_.steps; i <= options_.steps; ++i) {
        const int later = curve.b == camera ? i - found_[other].step : found_[other].step - i;
        const bool inside = std::abs(later) <= reach;
        sums[i + options_.steps] += curve.samples * (inside ? curve.costs[later + reach] : 1.0);
      }
    }
    if (samples <= 0.0) return std::nullopt;
    const auto best = std::min_element(sums.begin(), sums.end());
    FoundLag found{true, static_cast<int>(best - sums.begin()) - options_.steps, 1.0};
    double second = samples;
    for (int i = 0; i < static_cast<int>(sums.size()); ++i)
      if (std::abs(i - found.step - options_.steps) > options_.guard) second = std::min(second, sums[i]);
    found.contrast = second / std::max(*best, 1e-9 * samples);
    return found;
  }

  std::vector<LagCurve> curves_;
  LagSearchOptions options_;
  std::vector<FoundLag> found_;
};

}  // namespace

std::vector<FoundLag> search_lags(const std::vector<Camera>& cameras, const PointTracks& tracks,
                                  const LagSearchOptions& options) {
  std::vector<LagCurve> curves;
  for (const auto& [a, b] : pairs_to_compare(cameras)) curves.push_back(curve_of(cameras, tracks, a, b, options));
  return LagGraph(tracks.num_cameras(), std::move(curves), options).solve();
}

}  // namespace doppel
