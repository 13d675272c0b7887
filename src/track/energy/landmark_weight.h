#pragma once

#include <string>

namespace doppel {

/// The weight of a landmark's keypoints in a fit: 1, but 1/7 for each of the 21 points of a hand. Together they count
/// as three points, as many as a layout of the body has beyond the wrist. With weights of 1, the many points of the
/// small hands would decide the pose of the arms and of the trunk.
double landmark_weight(const std::string& name);

}  // namespace doppel
