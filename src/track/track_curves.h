#pragma once

#include <string>

#include "doppel/track/track_report.h"

namespace doppel {

/// An HTML page of curves over the frames of every sequence: overlap with the mask, distance from keypoints, and, where
/// the capture has ground truth, distances from its joints and vertices.
std::string track_curves(const TrackReport& report);

}  // namespace doppel
