#include "doppel/detect/keypoints/keypoint_filter.h"

#include <algorithm>
#include <cmath>

#include "doppel/core/statistics.h"

namespace doppel {

namespace {

using Track = std::vector<Keypoint>;  ///< one landmark in the frames of one segment

constexpr double kSpreads = 4.0;  ///< largest distance of a point from its neighbours, in spreads of the neighbours
constexpr double kDeviationOfMedian = 1.4826;  ///< standard deviation of a normal distribution per median deviation
constexpr float kBridgedConfidence = 0.5f;

bool seen(const Keypoint& point) { return point.confidence > 0.0f; }

bool is_outlier(const Track& track, int frame, const KeypointFilter& filter, double longer_side) {
  std::vector<double> x, y, distance;
  const int last = std::min<int>(static_cast<int>(track.size()) - 1, frame + filter.window);
  std::vector<Keypoint> near;
  for (int f = std::max(0, frame - filter.window); f <= last; ++f)
    if (seen(track[f])) near.push_back(track[f]);
  if (near.size() < 3) return false;  // of two points that differ, either may be wrong
  for (const Keypoint& point : near) {
    x.push_back(point.x);
    y.push_back(point.y);
  }
  const double mx = median(x), my = median(y);
  for (const Keypoint& point : near) distance.push_back(std::hypot(point.x - mx, point.y - my));
  const double allowed = std::max(filter.outlier * longer_side, kSpreads * kDeviationOfMedian * median(distance));
  return std::hypot(track[frame].x - mx, track[frame].y - my) > allowed;
}

void drop_outliers(Track& track, const KeypointFilter& filter, double longer_side) {
  const Track raw = track;
  for (int f = 0; f < static_cast<int>(track.size()); ++f)
    if (seen(raw[f]) && is_outlier(raw, f, filter, longer_side)) track[f] = {};
}

void bridge_gaps(Track& track, int longest) {
  int before = -1;  // the last seen frame
  for (int f = 0; f < static_cast<int>(track.size()); ++f) {
    if (!seen(track[f])) continue;
    const Keypoint from = before < 0 ? Keypoint() : track[before], to = track[f];
    const int missing = f - before - 1;
    if (before >= 0 && missing <= longest)
      for (int g = before + 1; g < f; ++g) {
        const float share = static_cast<float>(g - before) / static_cast<float>(f - before);
        track[g] = {from.x + share * (to.x - from.x), from.y + share * (to.y - from.y),
                    kBridgedConfidence * std::min(from.confidence, to.confidence)};
      }
    before = f;
  }
}

/// Smooths the positions; the confidences stay the same.
void smooth(Track& track, const KeypointFilter& filter) {
  if (filter.sigma <= 0.0) return;
  const Track raw = track;
  const int count = static_cast<int>(track.size());
  for (int f = 0; f < count; ++f) {
    if (!seen(raw[f])) continue;
    double x = 0.0, y = 0.0, total = 0.0;
    for (int g = std::max(0, f - filter.window); g <= std::min(count - 1, f + filter.window); ++g) {
      const double step = (g - f) / filter.sigma;
      const double weight = raw[g].confidence * std::exp(-0.5 * step * step);
      x += weight * raw[g].x;
      y += weight * raw[g].y;
      total += weight;
    }
    track[f].x = static_cast<float>(x / total);
    track[f].y = static_cast<float>(y / total);
  }
}

}  // namespace

void filter_keypoints(std::vector<std::vector<Keypoint>>& frames, const std::vector<long>& segments,
                      const KeypointFilter& filter, double longer_side) {
  if (filter.window <= 0 || frames.empty()) return;
  const auto count = static_cast<long>(frames.size());
  std::vector<long> starts{0};
  for (const long start : segments)
    if (start > starts.back() && start < count) starts.push_back(start);
  starts.push_back(count);
  for (std::size_t s = 0; s + 1 < starts.size(); ++s)
    for (std::size_t m = 0; m < frames[0].size(); ++m) {
      Track track;
      for (long f = starts[s]; f < starts[s + 1]; ++f) track.push_back(frames[f][m]);
      drop_outliers(track, filter, longer_side);
      bridge_gaps(track, filter.window);
      smooth(track, filter);
      for (long f = starts[s]; f < starts[s + 1]; ++f) frames[f][m] = track[f - starts[s]];
    }
}

}  // namespace doppel
