#pragma once

#include <string>
#include <vector>

namespace doppel {

/// The weights of the landmarks' keypoints in a fit, [M]: 1, with three exceptions.
/// - Each of the 21 points of a hand: 1/7. Together they count as three points, as many as a layout of the body has
///   beyond the wrist. With weights of 1, the many points of the small hands would decide the pose of the arms and of
///   the trunk.
/// - The points of the face mesh (`is_face_point`): they count together as three points, too.
/// - Thumb, index and little finger of a network of the body, where the layout has the 21 points of the same hand: 0.
///   Such a network sees them closer together than the knuckles are, so the fit would make the hand too narrow.
/// @param landmarks [M] names
std::vector<double> landmark_fit_weights(const std::vector<std::string>& landmarks);

}  // namespace doppel
