#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <map>
#include <string>

#include "doppel/character/character.h"
#include "doppel/io/motion_import/read_motion_file.h"
#include "doppel/rigging/joints/body_skeleton.h"

/// A character of 1.83 m with arms half lowered, and what it should do: all figures in the files of these tests have
/// other proportions and rest in a T-pose.
namespace doppel::support {

using Eigen::Vector3d;

inline Character tall_character() {
  BodyJoints joints;
  joints.positions = {{"pelvis", {0, 1.02, 0}},
                      {"spine", {0, 1.12, -0.01}},
                      {"chest", {0, 1.27, -0.01}},
                      {"neck", {0, 1.54, -0.02}},
                      {"head", {0, 1.62, 0}}};
  const std::map<std::string, Vector3d> left{{"clavicle", {0.03, 1.49, 0}},  {"shoulder", {0.20, 1.49, -0.01}},
                                             {"elbow", {0.42, 1.27, -0.02}}, {"wrist", {0.61, 1.08, 0.01}},
                                             {"hip", {0.10, 0.97, 0}},       {"knee", {0.12, 0.52, 0.01}},
                                             {"ankle", {0.13, 0.08, -0.02}}, {"toe", {0.14, 0.02, 0.12}}};
  for (const auto& [name, at] : left) {
    joints.positions["left_" + name] = at;
    joints.positions["right_" + name] = Vector3d(-at.x(), at.y(), at.z());
  }
  const BodySkeleton body = make_body_skeleton(joints);
  Character character;
  character.name = "tall";
  character.skeleton = body.skeleton;
  character.rest_dofs = body.rest_dofs;
  return character;
}

/// Where the last joint of a bone is in a pose.
inline Vector3d position_of(const Character& character, const std::vector<double>& dofs, const std::string& bone) {
  const auto pose = character.skeleton.pose(dofs);
  for (int j = character.skeleton.num_joints(); j-- > 0;)
    if (bone_name(character.skeleton.joints[j].name) == bone) return pose[j].translation();
  throw std::logic_error("no bone " + bone);
}

inline double degrees_between(const Vector3d& a, const Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180 / M_PI;
}

/// The angle between a bone of the character and a direction, degrees.
inline double off_direction(const Character& character, const std::vector<double>& dofs, const std::string& from,
                            const std::string& to, const Vector3d& direction) {
  return degrees_between(position_of(character, dofs, to) - position_of(character, dofs, from), direction);
}

}  // namespace doppel::support
