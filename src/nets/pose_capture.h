#pragma once

/// From an image to a person in the world: PoseNet, the kinematics layer and global alignment in one (5.5).

#include <torch/torch.h>

#include "doppel/layers/global_alignment/global_alignment.h"
#include "doppel/layers/landmarks/landmarks.h"
#include "doppel/layers/pose_dofs.h"
#include "doppel/nets/pose_net.h"

namespace doppel {

/// What one camera shows of a person, and what places the person in the world.
struct PersonView {
  torch::Tensor image;            ///< [B,3,S,S] the network's input
  torch::Tensor camera_rotation;  ///< [B,3,3] of the camera that took it, camera from world
  LandmarkRays rays;              ///< of the landmarks' detections, in this camera or in many
  torch::Tensor prior;  ///< [B,3] where the person is assumed when the rays do not tell; undefined: the origin
};

struct CapturedPose {
  torch::Tensor theta;      ///< [B,P]
  torch::Tensor rotation;   ///< [B,3,3] of the root, world from root
  torch::Tensor position;   ///< [B,3] of the root's pivot, world metres
  torch::Tensor landmarks;  ///< [B,M,3] world metres
  torch::Tensor valid;      ///< bool [B]: the rays determine the position (GlobalAlignment::valid)
};

/// Differentiable from image to landmarks.
CapturedPose capture_pose(PoseNet& network, const PoseDofs& pose, const Landmarks& landmarks, const PersonView& view,
                          const GlobalAlignmentOptions& options = {});

}  // namespace doppel
