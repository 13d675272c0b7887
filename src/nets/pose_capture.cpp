#include "doppel/nets/pose_capture.h"

namespace doppel {

CapturedPose capture_pose(PoseNet& network, const PoseDofs& pose, const Landmarks& landmarks, const PersonView& view,
                          const GlobalAlignmentOptions& options) {
  const auto [theta, alpha] = network->forward(view.image);
  CapturedPose captured;
  captured.theta = theta;
  captured.rotation = root_in_world(alpha, view.camera_rotation);
  const torch::Tensor turned = turn_points(captured.rotation, landmarks->forward(pose.root_relative(theta)));
  const GlobalAlignment aligned = global_alignment(turned, view.rays, view.prior, options);
  captured.position = aligned.translation;
  captured.valid = aligned.valid;
  captured.landmarks = turned + captured.position.unsqueeze(1);
  return captured;
}

}  // namespace doppel
