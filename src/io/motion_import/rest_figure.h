#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

namespace doppel {

/// A joint of a figure in T-pose: feet on the floor, arms out, palms down, facing z, its left at +x, y up.
struct FigureJoint {
  const char* name;
  int parent;                ///< smaller than the joint's own index, -1 for the root
  Eigen::Vector3d position;  ///< metres
};

/// The 22 joints of the body in the order and with the parents that SMPL, SMPL-H and SMPL-X share. The model's own rest
/// positions depend on a licensed file and on the person, and motion files do not have them. These positions are those
/// of a body of 1.70 m with the segments of Drillis and Contini (Winter, Biomechanics and Motor Control of Human
/// Movement, figure 4.1): thigh 0.245, shank 0.246, ankle 0.039, upper arm 0.186, forearm 0.146 of the stature, hips at
/// 0.530, shoulders at 0.818. What retargeting takes of them are directions and the length of the leg.
const std::array<FigureJoint, 22>& rest_figure();

}  // namespace doppel
