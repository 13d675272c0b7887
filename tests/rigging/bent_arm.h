#pragma once

#include <algorithm>
#include <cmath>
#include <string>

#include "doppel/rigging/joints/body_skeleton.h"
#include "doppel/rigging/weights/weight_field.h"
#include "rigging/plain_body.h"
#include "rigging/tubes.h"

namespace doppel::support {

/// A plain body of which only the left arm has a surface: one tube from the shoulder to the wrist.
struct BentArm {
  static constexpr double kRadius = 0.045;
  Character character;
  WeightField field;

  /// @param forward distance of the tube's axis from the bones, metres
  /// @param step between the rings of the tube, metres
  explicit BentArm(double forward, double step = 0.01) {
    const BodyJoints joints = plain_body(0.8, 0.0);
    const BodySkeleton body = make_body_skeleton(joints);
    character.name = "arm";
    character.skeleton = body.skeleton;
    character.rest_dofs = body.rest_dofs;
    const Eigen::Vector3d shoulder = joints.at("left_shoulder"), wrist = joints.at("left_wrist");
    const auto turn = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitX(), wrist - shoulder);
    character.mesh = cylinder(0, (wrist - shoulder).norm(), kRadius, Eigen::Vector3d::Zero(), step);
    for (const HeatBone& bone : heat_bones(joints)) character.skin.bones.push_back(bone.name);
    const double elbow = (joints.at("left_elbow") - shoulder).norm();
    field = WeightField::Zero(character.num_vertices(), character.skin.num_bones());
    for (int v = 0; v < character.num_vertices(); ++v) {
      const double below = 1 / (1 + std::exp(-1.6 * (character.mesh.vertices[v].x() - elbow) / kRadius));
      field(v, bone("LeftArm")) = static_cast<float>(1 - below);
      field(v, bone("LeftForeArm")) = static_cast<float>(below);
      character.mesh.vertices[v] = shoulder + turn * character.mesh.vertices[v] + forward * Eigen::Vector3d::UnitZ();
    }
    set_skin();
    complete_character(character);
  }

  int bone(const std::string& name) const {
    const auto& bones = character.skin.bones;
    return static_cast<int>(std::find(bones.begin(), bones.end(), name) - bones.begin());
  }
  void set_skin() { character.skin = sparse_weights(field, character.skin.bones); }
};

}  // namespace doppel::support
