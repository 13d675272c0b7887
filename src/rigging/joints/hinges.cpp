#include "doppel/rigging/joints/hinges.h"

#include <algorithm>
#include <string>

#include "doppel/core/error.h"

namespace doppel {
namespace {

int index_of_bone(const Character& character, const std::string& name) {
  const auto& bones = character.skin.bones;
  const auto found = std::find(bones.begin(), bones.end(), name);
  if (found == bones.end())
    fail("examining how '{}' bends: its skeleton has no bone '{}', as those of `doppel character create` have",
         character.name, name);
  return static_cast<int>(found - bones.begin());
}

bool moves(const Skeleton& skeleton, int upper, int joint) {
  while (joint > upper) joint = skeleton.joints[joint].parent;
  return joint == upper;
}

/// @param bones of the limb; the hinge is where the second one begins
/// @param end the bone that begins where the lower bone ends
Hinge hinge_of(const Character& character, const std::vector<Eigen::Affine3d>& rest,
               const std::vector<std::string>& bones, const std::string& end) {
  const auto joint_of = [&](const std::string& bone) { return character.bone_joint[index_of_bone(character, bone)]; };
  const auto position = [&](int joint) { return Eigen::Vector3d(rest[joint].translation()); };
  Hinge hinge;
  for (const std::string& bone : bones) hinge.limb.push_back(index_of_bone(character, bone));
  const int joint = joint_of(bones[1]);
  for (const int other : character.bone_joint) hinge.below.push_back(moves(character.skeleton, joint, other));
  hinge.positions = {position(joint_of(bones[0])), position(joint), position(joint_of(end))};
  hinge.axis = (rest[joint].linear() * character.skeleton.joints[joint].axis).normalized();
  return hinge;
}

}  // namespace

std::vector<Hinge> find_hinges(const Character& character) {
  const std::vector<Eigen::Affine3d> rest = character.skeleton.pose(character.rest_dofs);
  std::vector<Hinge> hinges;
  for (const std::string side : {"Left", "Right"}) {
    hinges.push_back(hinge_of(character, rest, {side + "Arm", side + "ForeArm", side + "ForeArmRoll"}, side + "Hand"));
    hinges.push_back(hinge_of(character, rest, {side + "UpLeg", side + "Leg"}, side + "Foot"));
    hinges.back().knee = true;
  }
  return hinges;
}

}  // namespace doppel
