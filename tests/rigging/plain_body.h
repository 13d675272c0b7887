#pragma once

#include <string>

#include "doppel/rigging/joints/body_joints.h"

namespace doppel::support {

/// The twelve limb joints of an adult who looks along +z. @param arm_down angle of the arms below the horizontal,
/// radians @param bend of the elbows, forwards
inline BodyJoints plain_body(double arm_down = 0.8, double bend = 0.3) {
  BodyJoints joints;
  for (const std::string side : {"left_", "right_"}) {
    const double s = side == "left_" ? 1 : -1;
    const Eigen::Vector3d shoulder(s * 0.17, 1.40, 0.0);
    const Eigen::Vector3d arm(s * std::cos(arm_down), -std::sin(arm_down), 0);
    const Eigen::Vector3d elbow = shoulder + 0.27 * arm;
    joints.positions[side + "shoulder"] = shoulder;
    joints.positions[side + "elbow"] = elbow;
    joints.positions[side + "wrist"] =
        elbow + 0.25 * (std::cos(bend) * arm + std::sin(bend) * Eigen::Vector3d::UnitZ());
    joints.positions[side + "hip"] = {s * 0.10, 0.92, 0.0};
    joints.positions[side + "knee"] = {s * 0.12, 0.50, 0.02};
    joints.positions[side + "ankle"] = {s * 0.13, 0.08, -0.01};
  }
  return joints;
}

}  // namespace doppel::support
