#include "doppel/calibration/estimation/smooth_track.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "doppel/core/statistics.h"

namespace doppel {
namespace {

constexpr double kWidthsOfWindow = 3.0;
constexpr double kWidthsToNeighbour = 2.0;
constexpr long kMedianReach = 2;  // frames
constexpr std::size_t kMinMedianSamples = 3;

}  // namespace

MovingPoint smooth_sample(const CameraTrack& track, double frame, int point, double width) {
  const double reach = std::max(2.0, kWidthsOfWindow * width);
  const double near = std::max(1.0, kWidthsToNeighbour * width);
  if (!(frame >= 0.0 && frame <= static_cast<double>(track.num_frames() - 1))) return {};
  const long first = std::max(0L, static_cast<long>(std::ceil(frame - reach)));
  const long last = std::min(track.num_frames() - 1, static_cast<long>(std::floor(frame + reach)));
  double weight = 0.0, moment = 0.0, square = 0.0;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero(), product = Eigen::Vector2d::Zero();
  bool before = false, after = false;
  int count = 0;
  for (long f = first; f <= last; ++f) {
    const TrackPoint& seen = track.at(f, point);
    if (!seen.seen()) continue;
    const double x = static_cast<double>(f) - frame,
                 w = seen.confidence * seen.confidence * std::pow(1.0 - x * x / (reach * reach), 3);
    before |= x <= 0.0 && x >= -near;
    after |= x >= 0.0 && x <= near;
    ++count;
    weight += w;
    moment += w * x;
    square += w * x * x;
    sum += w * seen.pixel;
    product += w * x * seen.pixel;
  }
  const double determinant = weight * square - moment * moment;
  if (count < 3 || !(determinant > 1e-9 * weight * square)) return {};
  return {true, before && after, (square * sum - moment * product) / determinant,
          (weight * product - moment * sum) / determinant};
}

CameraTrack smooth_track(const CameraTrack& track, double width) {
  CameraTrack smooth = track;
  for (long frame = 0; frame < track.num_frames(); ++frame)
    for (int k = 0; k < track.num_points(); ++k) {
      const MovingPoint point = smooth_sample(track, static_cast<double>(frame), k, width);
      smooth.at(frame, k) = point.between ? TrackPoint{point.pixel, 1.0} : TrackPoint{};
    }
  return smooth;
}

void drop_jumps(CameraTrack& track, double limit) {
  const CameraTrack seen = track;
  for (long frame = 0; frame < track.num_frames(); ++frame)
    for (int k = 0; k < track.num_points(); ++k) {
      if (!seen.at(frame, k).seen()) continue;
      std::vector<double> x, y;
      const long last = std::min(track.num_frames() - 1, frame + kMedianReach);
      for (long f = std::max(0L, frame - kMedianReach); f <= last; ++f) {
        if (!seen.at(f, k).seen()) continue;
        x.push_back(seen.at(f, k).pixel.x());
        y.push_back(seen.at(f, k).pixel.y());
      }
      const Eigen::Vector2d middle(quantile(x, 0.5), quantile(y, 0.5));
      const bool jumps = (seen.at(frame, k).pixel - middle).cwiseAbs().maxCoeff() > limit;
      if (x.size() < kMinMedianSamples || jumps) track.at(frame, k) = {};
    }
}

}  // namespace doppel
