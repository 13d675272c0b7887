#pragma once

#include <string>

#include "doppel/character/character.h"
#include "doppel/rigging/joints/body_joints.h"

namespace doppel {

inline constexpr int kFingerBones = 3;

/// "LeftHandIndex2": the bone from point k of a finger to point k + 1, named as in Mixamo's skeletons.
/// @param side "left_" or "right_" @param k 1 to 3
std::string finger_bone(const std::string& side, const Finger& finger, int k);

/// Divides the skinning weights of the bones LeftHand and RightHand among the hand and its fingers, for hands whose
/// finger points are known. The bone of the hand is the lines from the wrist to point 1 of each finger. A vertex at the
/// distance d_b from bone b moves with b in proportion to exp(-(d_b - min d) / (0.008 l)), l the length of the hand.
/// These shares are then averaged over edges.
/// @param character with mesh, skeleton and skinning weights, in the rest pose of `joints`; bones are added to its skin
/// @pre make_body_skeleton has accepted the joints
void divide_hand_weights(Character& character, const BodyJoints& joints);

}  // namespace doppel
