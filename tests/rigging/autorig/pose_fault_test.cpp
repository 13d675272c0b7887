#include <gmock/gmock.h>

#include "doppel/rigging/autorig/find_joints.h"

namespace doppel::pose_fault_test {
namespace {

using ::testing::HasSubstr;

/// A person who looks along +z, on feet or on a chair.
BodyJoints person(bool sits) {
  BodyJoints joints;
  for (const double side : {1.0, -1.0}) {
    const std::string s = side > 0 ? "left_" : "right_";
    joints.positions[s + "shoulder"] = {0.2 * side, 1.45, 0.0};
    joints.positions[s + "hip"] = {0.1 * side, 0.95, 0.0};
    joints.positions[s + "knee"] = sits ? Eigen::Vector3d(0.1 * side, 0.9, 0.45) : Eigen::Vector3d(0.1 * side, 0.5, 0);
    joints.positions[s + "ankle"] = joints.at(s + "knee") - Eigen::Vector3d(0, 0.4, 0);
  }
  return joints;
}

TEST(PoseFault, ASittingPersonIsRefused) {
  EXPECT_EQ(pose_fault(person(false)), "");
  EXPECT_THAT(pose_fault(person(true)), HasSubstr("sits"));
}

TEST(PoseFault, ALiftedKneeIsNoFault) {
  BodyJoints joints = person(false);
  joints.positions["left_knee"] = {0.1, 0.9, 0.2};
  joints.positions["left_ankle"] = {0.1, 0.85, 0.6};
  EXPECT_EQ(pose_fault(joints), "");
}

}  // namespace
}  // namespace doppel::pose_fault_test
