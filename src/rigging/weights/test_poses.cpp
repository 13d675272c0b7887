#include "doppel/rigging/weights/test_poses.h"

#include "doppel/core/error.h"

namespace doppel {
namespace {

struct NamedAngle {
  std::string dof;  ///< a `*` at the beginning stands for Left and for Right
  double angle;     ///< radians
};
struct NamedPose {
  const char* name;
  std::vector<NamedAngle> angles;
};

/// The signs are those of make_body_skeleton: positive is forwards, outwards or upwards, flexion.
const std::vector<NamedPose>& named_poses() {
  static const std::vector<NamedPose> poses{
      {"arms overhead",
       {{"*Shoulder_rz", 0.4}, {"*Arm_rz", 1.4}, {"*Arm_ry", 0.1}, {"*Arm_rx", 0.0}, {"*ForeArm_ry", 0.1}}},
      {"elbows bent", {{"*Arm_rz", 0.0}, {"*Arm_ry", 1.4}, {"*Arm_rx", 1.4}, {"*ForeArm_ry", 2.4}}},
      {"deep squat",
       {{"*UpLeg_rx", 2.0},
        {"*UpLeg_rz", 0.35},
        {"*Leg_rx", 2.3},
        {"*Foot_rx", 0.5},
        {"Spine_rx", 0.5},
        {"*Arm_rz", 0.0},
        {"*Arm_ry", 1.3},
        {"*Arm_rx", 0.0}}},
      {"high kick", {{"LeftUpLeg_rx", 1.6}, {"LeftLeg_rx", 0.05}, {"RightUpLeg_rx", -0.4}, {"RightLeg_rx", 0.05}}},
      {"twist", {{"Spine_ry", 0.8}, {"Head_ry", 1.0}}}};
  return poses;
}

void set_angle(const Skeleton& skeleton, const std::string& name, double angle, std::vector<double>& dofs) {
  const auto dof = skeleton.find_dof(name);
  if (!dof)
    fail(
        "posing a skeleton for a test: it has no DoF '{}'; the test poses belong to the skeletons that `doppel "
        "character create` makes",
        name);
  dofs[*dof] = angle;
}

}  // namespace

std::vector<TestPose> test_poses(const Skeleton& skeleton, const std::vector<double>& rest_dofs) {
  std::vector<TestPose> result;
  for (const NamedPose& pose : named_poses()) {
    result.push_back({pose.name, rest_dofs});
    for (const auto& [name, angle] : pose.angles) {
      if (name[0] != '*')
        set_angle(skeleton, name, angle, result.back().dofs);
      else
        for (const char* side : {"Left", "Right"})
          set_angle(skeleton, side + name.substr(1), angle, result.back().dofs);
    }
  }
  return result;
}

}  // namespace doppel
