#pragma once

#include <vector>

#include "doppel/character/character.h"
#include "doppel/rigging/joints/limb_piece.h"

namespace doppel {

/// A joint of a limb that bends about one axis, in the rest pose.
struct Hinge {
  bool knee = false;        ///< or an elbow
  std::vector<int> limb;    ///< bones on both sides of the joint, the upper one first
  std::vector<bool> below;  ///< [Bn] the bones that the joint moves
  LimbPositions positions;
  Eigen::Vector3d axis;  ///< unit; a positive angle bends the limb
};

/// Elbows and knees of a character of make_body_skeleton.
/// @throws Error where the skeleton has no bones of arms and legs
std::vector<Hinge> find_hinges(const Character& character);

}  // namespace doppel
