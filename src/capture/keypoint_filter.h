#pragma once

#include <vector>

#include "doppel/capture/keypoints.h"

namespace doppel {

/// How the keypoints of one camera are made steady over time. Off unless `window` > 0.
struct KeypointFilter {
  int window = 0;         ///< frames looked at on either side
  double outlier = 0.02;  ///< how far from its neighbours a point may lie, of the image's longer side, or four times
                          ///< their own spread
  double sigma = 1.0;     ///< of the Gaussian, frames; 0: points are kept or dropped, not moved
};

/// Filters each landmark's track on its own:
/// 1. A point farther than allowed from the median of the seen points within `window` frames is dropped.
/// 2. Gaps of at most `window` frames between two seen points are bridged by a straight line, with half of the lower
///    confidence of its ends. Longer gaps, and those at the ends of a segment, stay unseen.
/// 3. What is seen is averaged over `window` frames by a Gaussian times the confidence.
/// @param frames [F] of [M], consecutive frames
/// @param segments first frames of further segments, ascending; nothing reaches over a cut
/// @param longer_side of the images, pixels
void filter_keypoints(std::vector<std::vector<Keypoint>>& frames, const std::vector<long>& segments,
                      const KeypointFilter& filter, double longer_side);

}  // namespace doppel
