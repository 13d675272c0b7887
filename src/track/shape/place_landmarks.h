#pragma once

#include <vector>

#include "doppel/track/shape/shape_and_poses.h"

namespace doppel {

/// Finds where on the body the detector of a capture sees its landmarks, over many frames together: by turns the poses,
/// which masks hold where there are any, and the places (LandmarkPlaces). The bones keep their lengths.
/// @return [M] the landmarks of the footage at these places
/// @throws Error when no frame can be fitted
std::vector<Marker> place_landmarks(const Footage& footage, const std::vector<FootageSequence>& sequences,
                                    const TrackConfig& config, int frames = 48);

}  // namespace doppel
