#include "doppel/track/deepcap/smoothed_surfaces.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

namespace doppel {

using torch::Tensor;

SmoothedSurfaces::SmoothedSurfaces(std::function<Tensor(long)> surface, long frames, std::vector<long> cuts,
                                   double sigma)
    : make_(std::move(surface)),
      frames_(frames),
      cuts_(std::move(cuts)),
      sigma_(sigma),
      radius_(std::lround(std::ceil(2.0 * sigma))) {}

const Tensor& SmoothedSurfaces::surface(long frame) {
  Tensor& kept = near_[frame];
  if (!kept.defined()) kept = make_(frame);
  return kept;
}

Tensor SmoothedSurfaces::at(long frame) {
  near_.erase(near_.begin(), near_.lower_bound(frame - radius_));
  if (!(sigma_ > 0.0)) return surface(frame);
  const auto next = std::upper_bound(cuts_.begin(), cuts_.end(), frame);
  const long begin = next == cuts_.begin() ? 0 : std::max(0L, *std::prev(next));
  const long end = next == cuts_.end() ? frames_ : std::min(frames_, *next);
  Tensor sum;
  double weights = 0.0;
  for (long f = std::max(begin, frame - radius_); f < std::min(end, frame + radius_ + 1); ++f) {
    const double distance = static_cast<double>(f - frame) / sigma_, weight = std::exp(-0.5 * distance * distance);
    const Tensor part = weight * surface(f).to(torch::kFloat64);
    sum = sum.defined() ? sum + part : part;
    weights += weight;
  }
  return (sum / weights).to(torch::kFloat32);
}

}  // namespace doppel
