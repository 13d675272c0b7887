#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

namespace doppel {

/// The landmarks that every body has, in the order of `joints.json`: pelvis, spine, chest, neck, head, then left and
/// right clavicle, shoulder, elbow, wrist, hip, knee, ankle, toe.
inline constexpr std::array<const char*, 21> kBodyLandmarks{
    "pelvis",         "spine",       "chest",       "neck",      "head",       "left_clavicle", "left_shoulder",
    "left_elbow",     "left_wrist",  "left_hip",    "left_knee", "left_ankle", "left_toe",      "right_clavicle",
    "right_shoulder", "right_elbow", "right_wrist", "right_hip", "right_knee", "right_ankle",   "right_toe"};

/// A joint of any rig: what landmarks are found from.
struct RigJoint {
  std::string name;
  int parent = -1;           ///< smaller than the joint's own index
  Eigen::Vector3d position;  ///< in the bind pose, y up, metres or any other unit
};

/// The joint of each landmark, or -1. Names of Mixamo, VRM, ReadyPlayerMe, MakeHuman, Unreal, Blender (rigify and
/// others), Biped, SMPL and Quaternius rigs are known. Where names say too little, the tree decides: two legs, a spine
/// that ends in a head, two arms; left is the body's own left by names, or by the direction of the feet.
std::array<int, kBodyLandmarks.size()> find_landmarks(const std::vector<RigJoint>& joints);

}  // namespace doppel
