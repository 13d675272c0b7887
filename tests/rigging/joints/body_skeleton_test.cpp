#include "doppel/rigging/joints/body_skeleton.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <set>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/detect/face/face_landmarks.h"
#include "doppel/detect/face/face_pose.h"
#include "doppel/detect/keypoints/keypoint_map.h"
#include "doppel/detect/keypoints/landmark_key.h"
#include "rigging/plain_body.h"

namespace doppel::body_skeleton_test {
namespace {

using Eigen::Vector3d;

/// The joints of the skeleton and the named joints that they must meet.
const std::vector<std::pair<std::string, std::string>> kJoints{
    {"Root_rx", "pelvis"}, {"Spine_ry", "spine"}, {"Chest_ry", "chest"}, {"Neck_rx", "neck"}, {"Head_rx", "head"}};
const std::vector<std::pair<std::string, std::string>> kSided{
    {"Shoulder_rz", "clavicle"}, {"Arm_rx", "shoulder"}, {"ForeArm_ry", "elbow"}, {"Hand_ry", "wrist"},
    {"UpLeg_ry", "hip"},         {"Leg_rx", "knee"},     {"Foot_rz", "ankle"},    {"ToeBase_rx", "toe"}};

Vector3d position(const BodySkeleton& body, const std::vector<double>& dofs, const std::string& joint) {
  return body.skeleton.pose(dofs)[*body.skeleton.find_joint(joint)].translation();
}

struct Stance {
  double arm_down, bend, heading;
};
class RestPoses : public ::testing::TestWithParam<Stance> {
 protected:
  void SetUp() override {
    joints_ = support::plain_body(GetParam().arm_down, GetParam().bend);
    for (auto& entry : joints_.positions)
      entry.second = Eigen::AngleAxisd(GetParam().heading, Vector3d::UnitY()) * entry.second;
    complete_joints(joints_);
    body_ = make_body_skeleton(joints_);
  }
  BodyJoints joints_;
  BodySkeleton body_;
};

TEST_P(RestPoses, AllJointsLieWhereTheyWereGiven) {
  const auto& rest = body_.rest_dofs;
  for (const auto& [joint, name] : kJoints) EXPECT_LT((position(body_, rest, joint) - joints_.at(name)).norm(), 1e-9);
  for (const auto& [joint, name] : kSided) {
    EXPECT_LT((position(body_, rest, "Left" + joint) - joints_.at("left_" + name)).norm(), 1e-9) << joint;
    EXPECT_LT((position(body_, rest, "Right" + joint) - joints_.at("right_" + name)).norm(), 1e-9) << joint;
  }
}

TEST_P(RestPoses, RestDofsLieWithinTheLimitsAndTheRootIsUsual) {
  for (int d = 0; d < body_.skeleton.num_dofs(); ++d)
    if (const auto& limits = body_.skeleton.dofs[d].limits) {
      EXPECT_GE(body_.rest_dofs[d], (*limits)[0]) << body_.skeleton.dofs[d].name;
      EXPECT_LE(body_.rest_dofs[d], (*limits)[1]) << body_.skeleton.dofs[d].name;
    }
  const Skeleton::Root root = body_.skeleton.root();
  EXPECT_THAT(root.axes, ::testing::ElementsAre(1, 2, 0));
  EXPECT_NEAR(body_.rest_dofs[root.rotation[0]], std::remainder(GetParam().heading, 2 * M_PI), 0.02);
}

/// The zero pose does not depend on the stance: arms to the sides, legs down, whatever the scan did.
TEST_P(RestPoses, TheZeroPoseIsTheSameForAll) {
  const std::vector<double> zero(body_.rest_dofs.size(), 0.0);
  const auto along = [&](const std::string& from, const std::string& to) {
    return Vector3d((position(body_, zero, to) - position(body_, zero, from)).normalized());
  };
  for (const double s : {1.0, -1.0}) {
    const std::string side = s > 0 ? "Left" : "Right";
    EXPECT_LT((along(side + "Arm_rx", side + "ForeArm_ry") - Vector3d(s, 0, 0)).norm(), 1e-6);
    EXPECT_LT((along(side + "ForeArm_ry", side + "Hand_ry") - Vector3d(s, 0, 0)).norm(), 0.05);
    EXPECT_LT((along(side + "UpLeg_ry", side + "Leg_rx") - Vector3d(0, -1, 0)).norm(), 1e-6);
    EXPECT_LT((along(side + "Leg_rx", side + "Foot_rz") - Vector3d(0, -1, 0)).norm(), 0.06);
    EXPECT_GT(along(side + "Foot_rz", side + "ToeBase_rx").z(), 0.8);
  }
}

/// A DoF means the same motion on both sides and in every stance.
TEST_P(RestPoses, DofsMoveAsTheirNamesSay) {
  const auto posed = [&](const std::string& dof, double angle, const std::string& joint) {
    std::vector<double> dofs(body_.rest_dofs.size(), 0.0);
    dofs[*body_.skeleton.find_dof(dof)] = angle;
    return Vector3d(position(body_, dofs, joint) - position(body_, std::vector<double>(dofs.size(), 0.0), joint));
  };
  for (const double s : {1.0, -1.0}) {
    const std::string side = s > 0 ? "Left" : "Right";
    EXPECT_GT(posed(side + "Arm_rz", 0.5, side + "Hand_ry").y(), 0.2);        // up
    EXPECT_GT(posed(side + "Arm_ry", 0.5, side + "Hand_ry").z(), 0.2);        // forwards
    EXPECT_GT(posed(side + "ForeArm_ry", 0.5, side + "Hand_ry").z(), 0.1);    // flexion
    EXPECT_GT(posed(side + "UpLeg_rx", 0.5, side + "Leg_rx").z(), 0.15);      // forwards
    EXPECT_GT(s * posed(side + "UpLeg_rz", 0.5, side + "Leg_rx").x(), 0.15);  // outwards
    EXPECT_GT(s * posed(side + "UpLeg_ry", 0.5, side + "ToeBase_rx").x(), 0.03);
    EXPECT_LT(posed(side + "Leg_rx", 0.5, side + "Foot_rz").z(), -0.15);     // backwards
    EXPECT_GT(posed(side + "Foot_rx", 0.5, side + "ToeBase_rx").y(), 0.03);  // toes up
    EXPECT_GT(posed(side + "Shoulder_rz", 0.3, side + "Arm_rx").y(), 0.01);
    EXPECT_GT(posed(side + "Shoulder_ry", 0.3, side + "Arm_rx").z(), 0.01);
  }
  EXPECT_GT(posed("Spine_rx", 0.5, "Head_rx").z(), 0.1);   // bends forwards
  EXPECT_LT(posed("Spine_rz", 0.5, "Head_rx").x(), -0.1);  // to the right
  EXPECT_GT(posed("Head_rx", 0.5, "HeadEE").z(), 0.05);
}

INSTANTIATE_TEST_SUITE_P(Stances, RestPoses,
                         ::testing::Values(Stance{0.0, 0.0, 0.0}, Stance{0.8, 0.3, 0.0}, Stance{1.4, 0.1, 0.0},
                                           Stance{0.8, 1.2, 2.5}, Stance{1.1, 0.6, -1.2}));

TEST(BodySkeleton, BonesOfHeatAreBonesOfTheSkeleton) {
  BodyJoints joints = support::plain_body();
  complete_joints(joints);
  const BodySkeleton body = make_body_skeleton(joints);
  const std::vector<Eigen::Affine3d> pose = body.skeleton.pose(body.rest_dofs);
  std::set<std::string> names;
  for (const HeatBone& bone : heat_bones(support::plain_body())) {
    EXPECT_TRUE(names.insert(bone.name).second) << bone.name;
    const int joint = body.skeleton.joint_of_bone(bone.name, BoneRule::exact);
    ASSERT_FALSE(bone.segments.empty()) << bone.name;
    EXPECT_LT((bone.segments[0][0] - pose[joint].translation()).norm(), 1e-9) << bone.name << " starts at its joint";
  }
  // All bones of the skeleton give heat, except those of fingers.
  for (const auto& [joint, name] : kJoints) EXPECT_TRUE(names.count(joint.substr(0, joint.find('_')))) << joint;
  for (const auto& [joint, name] : kSided)
    for (const std::string side : {"Left", "Right"})
      EXPECT_TRUE(names.count(side + joint.substr(0, joint.find('_')))) << side << joint;
}

TEST(BodySkeleton, ABoneNeedsALength) {
  BodyJoints joints = support::plain_body();
  joints.positions["left_wrist"] = joints.positions["left_elbow"];
  EXPECT_THROW(make_body_skeleton(joints), Error);
}

/// Every point of every layout is found: under its own name, or as part of a landmark that has a marker.
TEST(BodySkeleton, EveryPointOfEveryLayoutHasAMarker) {
  const BodyJoints joints = support::plain_body();
  BodySkeleton body = make_body_skeleton(joints);
  TriangleMesh mesh;  // a triangle far below; all points fall back to proportions
  mesh.vertices = {{0, -5, 0}, {0.1, -5, 0}, {0, -5, 0.1}};
  mesh.faces = {{0, 1, 2}};
  add_body_markers(body, joints, mesh);
  for (const std::string& name : builtin_keypoint_maps()) {
    const KeypointMap map = read_keypoint_map(name);
    std::vector<bool> found(map.layout.points.size(), false);
    for (const Marker& marker : body.skeleton.markers)
      if (const auto* entry = map.find(marker.name))
        for (const int point : entry->points) found[point] = true;
    for (std::size_t i = 0; i < found.size(); ++i) {
      const std::string& point = map.layout.points[i];
      EXPECT_TRUE(found[i] || is_face_point(point)) << name << ": " << point;
    }
  }
  const auto of_face =
      std::ranges::count_if(body.skeleton.markers, [](const Marker& marker) { return is_face_point(marker.name); });
  EXPECT_EQ(as_size(of_face), kFaceLandmarks.size()) << "the jaw and the expression move the others";
  std::set<std::string> names;
  for (const Marker& marker : body.skeleton.markers) EXPECT_TRUE(names.insert(marker.name).second) << marker.name;
}

}  // namespace
}  // namespace doppel::body_skeleton_test
