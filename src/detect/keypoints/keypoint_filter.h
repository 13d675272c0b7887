#pragma once

#include <vector>

#include "doppel/detect/keypoints/keypoints.h"

namespace doppel {

/// Settings of the temporal filter for the keypoints of one camera. The filter is off when `window` is 0.
struct KeypointFilter {
  int window = 0;         ///< frames considered on either side
  double outlier = 0.02;  ///< largest distance of a point from its neighbours, as a share of the image's longer side,
                          ///< or four times the spread of the neighbours
  double sigma = 1.0;     ///< of the Gaussian, frames; 0: points are kept or dropped, not moved

  bool operator==(const KeypointFilter&) const = default;
};

/// Filters each landmark's track on its own:
/// 1. A point that is too far (`outlier`) from the median of the seen points within `window` frames is dropped.
/// 2. Gaps of at most `window` frames between two seen points are filled by linear interpolation, with half of the
///    lower confidence of the two points. Longer gaps, and gaps at the ends of a segment, stay unseen.
/// 3. Seen points are averaged over `window` frames with Gaussian weights times the confidence.
/// @param frames [F] of [M], consecutive frames
/// @param segments first frames of further segments, ascending; the filter does not cross a cut
/// @param longer_side of the images, pixels
void filter_keypoints(std::vector<std::vector<Keypoint>>& frames, const std::vector<long>& segments,
                      const KeypointFilter& filter, double longer_side);

}  // namespace doppel
