#pragma once

#include <functional>
#include <vector>

namespace doppel {

/// The frames to keep of a track (Douglas-Peucker): first and last, and each farthest frame until all errors are small.
/// @param count frames of the track, at least 1
/// @param error `error(a, b, i)`: that of frame i, a < i < b, when a line from frame a to frame b replaces it
/// @return frames in ascending order; one frame when the first represents all
std::vector<int> key_frames(int count, double tolerance, const std::function<double(int, int, int)>& error);

}  // namespace doppel
