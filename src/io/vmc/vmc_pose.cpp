#include "doppel/io/vmc/vmc_pose.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "doppel/core/error.h"
#include "doppel/geometry/best_rotation.h"

namespace doppel {
namespace {

/// The names of Unity's HumanBodyBones by those of VRM 1.0. They differ in more than the case: what VRM calls the
/// proximal bone of a thumb is the intermediate one of Unity.
std::map<std::string, std::string> unity_by_vrm() {
  const auto& unity = name_convention(BoneNames::unity).names;
  std::map<std::string, std::string> names;
  for (const auto& [part, vrm] : name_convention(BoneNames::vrm).names) names[vrm] = unity.at(part);
  return names;
}

bool is_unity_finger(const std::string& name) {
  return name.ends_with("Proximal") || name.ends_with("Intermediate") || name.ends_with("Distal");
}

/// The rotation of a transform without scale.
Eigen::Matrix3d rotation_of(const Eigen::Affine3d& transform) { return transform.rotation(); }

Eigen::Vector3d in_unity(const Eigen::Vector3d& v) { return {-v.x(), v.y(), v.z()}; }
Eigen::Quaterniond in_unity(const Eigen::Matrix3d& rotation) {
  const Eigen::Quaterniond q(rotation);
  return Eigen::Quaterniond(q.w(), q.x(), -q.y(), -q.z()).normalized();
}

}  // namespace

VmcAvatar::VmcAvatar(const Character& character)
    : skeleton_(character.skeleton), figure_(make_figure(character, BoneNames::vrm)) {
  add_parts();
  for (const char* name : {"Hips", "Head", "LeftUpperArm", "RightUpperArm", "LeftUpperLeg", "RightUpperLeg"})
    if (part_named(name) < 0)
      fail<UsageError>("sending poses of {}: no joint was recognised as {}; name the joints as Mixamo or VRM do",
                       character.name, name);
  turn_to_t_pose();
}

int VmcAvatar::part_named(const std::string& name) const {
  for (std::size_t i = 0; i < parts_.size(); ++i)
    if (parts_[i].name == name) return static_cast<int>(i);
  return -1;
}

void VmcAvatar::add_parts() {
  const std::map<std::string, std::string> names = unity_by_vrm();
  std::vector<int> part_of(figure_.nodes.size(), -1);
  for (std::size_t n = 0; n < figure_.nodes.size(); ++n) {
    const FigureNode& node = figure_.nodes[n];
    const int above = node.parent < 0 ? -1 : part_of[node.parent];
    part_of[n] = above;
    const auto name = names.find(node.name);
    if (name == names.end() || (above < 0 && node.name != "hips")) continue;  // a bone is below the hips
    Part part;
    part.name = name->second;
    part.parent = above;
    part.node = static_cast<int>(n);
    part_of[n] = static_cast<int>(parts_.size());
    parts_.push_back(part);
  }
}

Eigen::Vector3d VmcAvatar::rest_position(int part) const {
  return facing_ * figure_.rest[parts_[part].node].translation();
}

void VmcAvatar::turn_to_t_pose() {
  const Eigen::Vector3d left = rest_position(part_named("LeftUpperLeg")) - rest_position(part_named("RightUpperLeg"));
  facing_ = Eigen::AngleAxisd(std::atan2(left.z(), left.x()), Eigen::Vector3d::UnitY()).toRotationMatrix();
  struct Limb {
    const char *bone, *end;
    Eigen::Vector3d direction;
  };
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX(), down = -Eigen::Vector3d::UnitY();
  const std::array<Limb, 8> limbs{{{"LeftUpperArm", "LeftLowerArm", x},
                                   {"LeftLowerArm", "LeftHand", x},
                                   {"RightUpperArm", "RightLowerArm", -x},
                                   {"RightLowerArm", "RightHand", -x},
                                   {"LeftUpperLeg", "LeftLowerLeg", down},
                                   {"LeftLowerLeg", "LeftFoot", down},
                                   {"RightUpperLeg", "RightLowerLeg", down},
                                   {"RightLowerLeg", "RightFoot", down}}};
  for (const Limb& limb : limbs) {
    const int bone = part_named(limb.bone), end = part_named(limb.end);
    if (bone < 0 || end < 0) continue;
    parts_[bone].t_pose = rotation_between(rest_position(end) - rest_position(bone), limb.direction).toRotationMatrix();
  }
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    Part& part = parts_[i];
    if (part.parent < 0) continue;
    const Part& parent = parts_[part.parent];
    // A hand goes on in the direction of the arm, a finger in that of the hand.
    if (part.name.ends_with("Hand") || is_unity_finger(part.name)) part.t_pose = parent.t_pose;
    if (is_unity_finger(part.name)) straighten_finger(static_cast<int>(i));
    part.offset = parent.t_pose * (rest_position(static_cast<int>(i)) - rest_position(part.parent));
  }
}

void VmcAvatar::straighten_finger(int bone) {
  Part& part = parts_[bone];
  if (part.name.find("Thumb") != std::string::npos) return;
  const auto next = std::find_if(parts_.begin(), parts_.end(), [&](const Part& other) { return other.parent == bone; });
  if (next == parts_.end()) return;
  const Eigen::Vector3d out = (part.name.starts_with("Left") ? 1.0 : -1.0) * Eigen::Vector3d::UnitX();
  const Eigen::Vector3d along =
      part.t_pose * (rest_position(static_cast<int>(next - parts_.begin())) - rest_position(bone));
  part.t_pose = rotation_between(along, out).toRotationMatrix() * part.t_pose;
}

std::vector<VmcBone> VmcAvatar::bones(const std::vector<double>& dofs) const {
  const std::vector<Eigen::Affine3d> posed = pose_nodes(figure_, skeleton_, dofs);
  std::vector<Eigen::Matrix3d> world;
  std::vector<VmcBone> bones;
  for (const Part& part : parts_) {
    const Eigen::Matrix3d turned = facing_ * rotation_of(posed[part.node]) *
                                   rotation_of(figure_.rest[part.node]).transpose() * facing_.transpose();
    world.push_back(turned * part.t_pose.transpose());
    const bool root = part.parent < 0;
    const Eigen::Vector3d position = root ? facing_ * posed[part.node].translation() : part.offset;
    const Eigen::Matrix3d local = root ? world.back() : Eigen::Matrix3d(world[part.parent].transpose() * world.back());
    bones.push_back({part.name, part.parent, in_unity(position), in_unity(local)});
  }
  return bones;
}

}  // namespace doppel
