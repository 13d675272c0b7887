#pragma once

#include "doppel/actor/trained_pose.h"
#include "doppel/track/live/live_view.h"

namespace doppel {

/// PoseNet as a finder of 3D joints (4.4). @param trained and @param view must outlive the finder
/// @throws Error as DeepcapTracker, or when the run was trained for another character
JointFinder joints_of_posenet(const LiveView& view, TrainedPose& trained);

}  // namespace doppel
