#pragma once

#include <map>
#include <vector>

#include "doppel/detect/keypoints/keypoints.h"

namespace doppel {

/// A person's points at a time between frames, for cameras that are not synchronous. Between two frames a point moves
/// in a line, and its confidence is the lower of the two. Where a point is not seen in one of the two frames, the frame
/// beyond takes its part; where it is not seen there either, it is not seen. At a whole number of frames, the points
/// are those of this frame.
/// @param track by frame, of equal numbers of points; frames may be missing
/// @param time in frames of the video
/// @return [n], or empty when all four frames around `time` are missing
Person person_at(const std::map<long, Person>& track, double time);

/// The same at several times.
std::vector<Person> interpolate_people(const std::map<long, Person>& track, const std::vector<double>& times);

}  // namespace doppel
