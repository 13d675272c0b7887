#pragma once

#include <optional>

#include "doppel/detect/blazepose/body_pose.h"
#include "doppel/detect/face/face_pose.h"

namespace doppel {

/// The region around the face of a body, pixels. Let e be the middle of the eyes, m that of the mouth, and a the vector
/// from the right eye to the left one. The centre is the middle of e and m. The side is 4.2 |a| or 3.8 |e - m|,
/// whichever is longer: a head that turns to the side shortens a, one that nods shortens e - m. The upper side faces
/// the sum of e - m and of a turned by a right angle.
/// @return nothing when the face looks away: the direction from the middle of the ears to the nose is more than 70
/// degrees from the direction to the camera, by the joints in space
std::optional<BodyRoi> face_roi(const BodyPose& body);

/// The region around the points of a face: 1.5 times the longer side of their box, whose sides are parallel to the line
/// through the outer corners of the eyes or at right angles to it.
BodyRoi face_roi(const FacePose& face);

}  // namespace doppel
