#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "doppel/detect/keypoints/keypoints.h"

namespace doppel {

/// Keypoints between two consecutive frames, by linear interpolation. A point that is not seen in both frames is not
/// seen between them; its confidence is the lower of the two.
/// @param before, after [M] @param share of the way from `before` to `after`, 0 to 1
inline std::vector<Keypoint> keypoints_between(const std::vector<Keypoint>& before, const std::vector<Keypoint>& after,
                                               double share) {
  std::vector<Keypoint> between(before.size());
  const auto w = static_cast<float>(share);
  for (std::size_t m = 0; m < before.size(); ++m) {
    const Keypoint &a = before[m], &b = after[m];
    if (a.confidence <= 0.0f || b.confidence <= 0.0f) continue;
    between[m] = {a.x + w * (b.x - a.x), a.y + w * (b.y - a.y), std::min(a.confidence, b.confidence)};
  }
  return between;
}

}  // namespace doppel
