#include "doppel/track/live/posenet_joints.h"

#include "doppel/character/landmarks.h"
#include "doppel/track/method_trackers.h"

namespace doppel {

JointFinder joints_of_posenet(const LiveView& view, TrainedPose& trained) {
  const std::shared_ptr<FrameTracker> tracker =
      make_deepcap_tracker(trained, view.character(), view.landmarks(), view.camera(), LostFrames::report);
  return [tracker, &view](const FootageFrame& seen) {
    std::vector<JointDetection> joints;
    const FrameResult found = tracker->track(seen);
    if (!found.pose.found()) return joints;
    const PinholeCamera& camera = view.camera();
    for (const Eigen::Vector3d& point :
         landmark_positions(view.character().skeleton, view.landmarks(), found.pose.dofs))
      joints.push_back({camera.R * point + camera.t, true});
    return joints;
  };
}

}  // namespace doppel
