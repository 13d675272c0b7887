#pragma once

#include <string>

#include "doppel/track/track_report.h"

namespace doppel {

/// A page of curves over the frames of every sequence: overlap with the mask, distance from keypoints, and, where they
/// are known, distances from true joints and vertices.
std::string track_curves(const TrackReport& report);

}  // namespace doppel
