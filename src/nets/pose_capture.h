#pragma once

/// From an image to a person in the world: PoseNet, the kinematics layer and global alignment in one (5.5).

#include <torch/types.h>

#include "doppel/layers/global_alignment/global_alignment.h"
#include "doppel/layers/landmarks/landmarks.h"
#include "doppel/layers/pose_dofs.h"
#include "doppel/nets/pose_net.h"

namespace doppel {

/// The input of pose capture: the image of a person in one camera, and the rays that determine the person's position.
struct PersonView {
  torch::Tensor image;            ///< [B,3,S,S] the network's input
  torch::Tensor camera_rotation;  ///< [B,3,3] of the image's camera, camera from world
  LandmarkRays rays;              ///< of the detected keypoints, in this camera or in several
  torch::Tensor prior;            ///< [B,3] assumed position where the rays do not determine it; undefined: the origin
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
