#include "doppel/io/rig_import/landmarks_of_rig.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace doppel::landmarks_of_rig_test {
namespace {

/// A body of 21 joints whose names are given in the order of kBodyLandmarks, at plausible positions.
std::vector<RigJoint> body(const std::vector<std::string>& names) {
  // Of each landmark: parent and position (left side; right is mirrored).
  const int parent[21] = {-1, 0, 1, 2, 3, 2, 5, 6, 7, 0, 9, 10, 11, 2, 13, 14, 15, 0, 17, 18, 19};
  const double x[8] = {0.05, 0.18, 0.45, 0.7, 0.1, 0.1, 0.1, 0.1}, y[8] = {1.4, 1.42, 1.42, 1.42, 0.9, 0.5, 0.08, 0.02},
               z[8] = {0, 0, 0, 0, 0, 0.02, -0.02, 0.12};
  const double up[5] = {0.95, 1.1, 1.3, 1.5, 1.6};
  std::vector<RigJoint> joints;
  for (int i = 0; i < 21; ++i) {
    const int limb = (i - 5) % 8;
    const Eigen::Vector3d position =
        i < 5 ? Eigen::Vector3d(0, up[i], 0) : Eigen::Vector3d((i < 13 ? 1 : -1) * x[limb], y[limb], z[limb]);
    joints.push_back({names[static_cast<std::size_t>(i)], parent[i], position});
  }
  return joints;
}

void expect_all(const std::vector<std::string>& names) {
  const auto found = find_landmarks(body(names));
  for (std::size_t i = 0; i < found.size(); ++i)
    EXPECT_EQ(found[i], static_cast<int>(i)) << kBodyLandmarks[i] << " " << names[i];
}

TEST(LandmarksOfRig, NamesOfManyRigs) {
  expect_all({"mixamorig:Hips",        "mixamorig:Spine",         "mixamorig:Spine2",   "mixamorig:Neck",
              "mixamorig:Head",        "mixamorig:LeftShoulder",  "mixamorig:LeftArm",  "mixamorig:LeftForeArm",
              "mixamorig:LeftHand",    "mixamorig:LeftUpLeg",     "mixamorig:LeftLeg",  "mixamorig:LeftFoot",
              "mixamorig:LeftToeBase", "mixamorig:RightShoulder", "mixamorig:RightArm", "mixamorig:RightForeArm",
              "mixamorig:RightHand",   "mixamorig:RightUpLeg",    "mixamorig:RightLeg", "mixamorig:RightFoot",
              "mixamorig:RightToeBase"});
  expect_all({"J_Bip_C_Hips",     "J_Bip_C_Spine",    "J_Bip_C_Chest",    "J_Bip_C_Neck",     "J_Bip_C_Head",
              "J_Bip_L_Shoulder", "J_Bip_L_UpperArm", "J_Bip_L_LowerArm", "J_Bip_L_Hand",     "J_Bip_L_UpperLeg",
              "J_Bip_L_LowerLeg", "J_Bip_L_Foot",     "J_Bip_L_ToeBase",  "J_Bip_R_Shoulder", "J_Bip_R_UpperArm",
              "J_Bip_R_LowerArm", "J_Bip_R_Hand",     "J_Bip_R_UpperLeg", "J_Bip_R_LowerLeg", "J_Bip_R_Foot",
              "J_Bip_R_ToeBase"});
  expect_all({"pelvis",     "spine_01",   "spine_03", "neck_01", "head",   "clavicle_l", "upperarm_l",
              "lowerarm_l", "hand_l",     "thigh_l",  "calf_l",  "foot_l", "ball_l",     "clavicle_r",
              "upperarm_r", "lowerarm_r", "hand_r",   "thigh_r", "calf_r", "foot_r",     "ball_r"});
  expect_all({"Pelvis",     "Spine1",  "Spine3",  "Neck",   "Head",    "L_Collar", "L_Shoulder",
              "L_Elbow",    "L_Wrist", "L_Hip",   "L_Knee", "L_Ankle", "L_Foot",   "R_Collar",
              "R_Shoulder", "R_Elbow", "R_Wrist", "R_Hip",  "R_Knee",  "R_Ankle",  "R_Foot"});
  expect_all({"root",         "spine05",      "spine01",      "neck01",       "head",         "clavicle.L",
              "upperarm01.L", "lowerarm01.L", "wrist.L",      "upperleg01.L", "lowerleg01.L", "foot.L",
              "toe1-1.L",     "clavicle.R",   "upperarm01.R", "lowerarm01.R", "wrist.R",      "upperleg01.R",
              "lowerleg01.R", "foot.R",       "toe1-1.R"});
  expect_all({"DEF-spine",       "DEF-spine.001",  "DEF-spine.003",   "DEF-neck",      "DEF-head",   "DEF-shoulder.L",
              "DEF-upper_arm.L", "DEF-forearm.L",  "DEF-hand.L",      "DEF-thigh.L",   "DEF-shin.L", "DEF-foot.L",
              "DEF-toe.L",       "DEF-shoulder.R", "DEF-upper_arm.R", "DEF-forearm.R", "DEF-hand.R", "DEF-thigh.R",
              "DEF-shin.R",      "DEF-foot.R",     "DEF-toe.R"});
  expect_all({"Bip01 Pelvis",     "Bip01 Spine",      "Bip01 Spine2",    "Bip01 Neck",       "Bip01 Head",
              "Bip01 L Clavicle", "Bip01 L UpperArm", "Bip01 L Forearm", "Bip01 L Hand",     "Bip01 L Thigh",
              "Bip01 L Calf",     "Bip01 L Foot",     "Bip01 L Toe0",    "Bip01 R Clavicle", "Bip01 R UpperArm",
              "Bip01 R Forearm",  "Bip01 R Hand",     "Bip01 R Thigh",   "Bip01 R Calf",     "Bip01 R Foot",
              "Bip01 R Toe0"});
}

TEST(LandmarksOfRig, TheShapeOfTheTreeWhereNamesSayNothing) {
  std::vector<std::string> names;
  for (int i = 0; i < 21; ++i) names.push_back("node_" + std::to_string(100 + i));
  expect_all(names);
  // Facing the other way, left is the other side.
  std::vector<RigJoint> joints = body(names);
  for (RigJoint& joint : joints) joint.position.z() *= -1;
  const auto found = find_landmarks(joints);
  EXPECT_EQ(found[6], 14);
  EXPECT_EQ(found[14], 6);
}

TEST(LandmarksOfRig, ATreeThatIsNoBodyHasNone) {
  const auto found = find_landmarks({{"a", -1, {0, 0, 0}}, {"b", 0, {0, 1, 0}}});
  EXPECT_TRUE(std::all_of(found.begin(), found.end(), [](int joint) { return joint == -1; }));
}

}  // namespace
}  // namespace doppel::landmarks_of_rig_test
