#pragma once

#include "doppel/detect/blazepose/body_pose.h"
#include "doppel/detect/hands/hand_pose.h"

namespace doppel {

/// The region around a hand of a body, pixels. Let k = (2 index + pinky) / 3 be the middle of the knuckles, d its
/// distance from the wrist, and a the longest upper arm or forearm of both arms in the image. The upper side of the
/// region faces the direction from the wrist to k. The centre is 0.2 d beyond k. The side is 3.2 d, and at least 0.65
/// a, because a hand that points to the camera has a short d.
BodyRoi hand_roi(const BodyPose& body, HandSide side);

}  // namespace doppel
