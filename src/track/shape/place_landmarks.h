#pragma once

#include <vector>

#include "doppel/track/shape/shape_and_poses.h"

namespace doppel {

/// Finds where on the body the detector of a capture sees its landmarks, over many frames together. Poses and positions
/// (LandmarkPositions) are fitted by turns; masks determine the poses too, where there are any. The bones keep their
/// lengths.
/// @return [M] the landmarks of the footage at these positions
/// @throws Error when no frame can be fitted
std::vector<Marker> place_landmarks(const Footage& footage, const std::vector<FootageSequence>& sequences,
                                    const TrackConfig& config, int frames = 48);

}  // namespace doppel
