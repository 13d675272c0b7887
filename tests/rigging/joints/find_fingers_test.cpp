// Fingers of scans with open hands: the parametric body, whose joints are known, and rigged bodies of others.
#include "doppel/rigging/joints/find_fingers.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "doppel/character/blend_skin.h"
#include "doppel/character/landmarks.h"
#include "doppel/core/statistics.h"
#include "doppel/rigging/body/body_model.h"
#include "doppel/rigging/body/measures.h"
#include "doppel/rigging/joints/body_skeleton.h"
#include "doppel/rigging/joints/fingers.h"
#include "rigging/plain_body.h"
#include "rigging/rigged_bodies.h"
#include "support/shared_folder.h"

namespace doppel::find_fingers_test {
namespace {

using Eigen::Vector3d;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

const char* const kSides[] = {"left_", "right_"};

/// A body in a pose, as a scan shows it, with the positions of its joints.
struct PosedBody {
  TriangleMesh mesh;
  BodyJoints joints;
};

/// The parametric body with some DoFs changed, by their names.
PosedBody posed_body(const std::map<std::string, double>& changes) {
  static const BodyModel kModel(6000, 200);
  static const Character kPerson = kModel.character("person", mean_measures());
  std::vector<double> dofs = kPerson.rest_dofs;
  for (const auto& [name, change] : changes)
    dofs[static_cast<std::size_t>(kPerson.skeleton.find_dof(name).value())] += change;
  PosedBody result{kPerson.mesh, kModel.joints(mean_measures())};
  result.mesh.vertices = posed_vertices(kPerson, dofs);
  std::vector<Marker> markers;
  for (const Marker& marker : kPerson.skeleton.markers)
    if (result.joints.has(marker.name)) markers.push_back(marker);
  const auto positions = landmark_positions(kPerson.skeleton, markers, dofs);
  for (std::size_t m = 0; m < markers.size(); ++m) result.joints.positions[markers[m].name] = positions[m];
  return result;
}

BodyJoints without_fingers(BodyJoints joints) {
  for (const char* side : kSides)
    for (const Finger& finger : kFingers)
      for (int k = 1; k <= kFingerPoints; ++k) joints.positions.erase(finger_point(side, finger, k));
  return joints;
}

/// The parametric body's fingers have proportions and knuckles of their own, so its joints are not met exactly. A
/// finger is 17 mm wide, so its tip on the surface is up to 8.5 mm from the point inside; the next one is 20 mm away.
void expect_fingers_near(const BodyJoints& found, const BodyJoints& expected) {
  for (const char* side : kSides) {
    ASSERT_TRUE(has_fingers(found, side));
    for (const Finger& finger : kFingers)
      for (int k = 1; k <= kFingerPoints; ++k) {
        const std::string name = finger_point(side, finger, k);
        EXPECT_LT((found.at(name) - expected.at(name)).norm(), k == kFingerPoints ? 0.0085 : 0.018) << name;
      }
    EXPECT_EQ(found.at(side + std::string("hand")), found.at(side + std::string("middle_finger1")));
    EXPECT_EQ(found.at(side + std::string("fingertip")), found.at(side + std::string("middle_finger4")));
  }
}

TEST(FindFingers, MeetsTheJointsOfTheParametricBody) {
  const PosedBody body = posed_body({});
  BodyJoints joints = without_fingers(body.joints);
  EXPECT_THAT(find_fingers(body.mesh, joints),
              ElementsAre("the left hand has five fingers", "the right hand has five fingers"));
  expect_fingers_near(joints, body.joints);
}

TEST(FindFingers, MeetsThemInTurnedHandsWithBentFingers) {
  const PosedBody body = posed_body({{"LeftForeArmRoll_rx", 0.9},
                                     {"RightForeArmRoll_rx", -0.7},
                                     {"LeftHandIndex1_rz", 0.3},
                                     {"LeftHandMiddle2_rz", 0.3},
                                     {"RightHandPinky1_rz", 0.3},
                                     {"RightHand_rz", 0.2}});
  BodyJoints joints = without_fingers(body.joints);
  find_fingers(body.mesh, joints);
  expect_fingers_near(joints, body.joints);
}

TEST(FindFingers, LeavesAHandWithoutOneOfItsFingers) {
  PosedBody body = posed_body({});
  const Vector3d middle = body.joints.at("left_pinky_finger3");
  std::erase_if(body.mesh.faces, [&](const Triangle& face) {
    const Vector3d& corner = body.mesh.vertices[static_cast<std::size_t>(face[0])];
    return (corner - middle).norm() < (body.joints.at("left_pinky_finger2") - middle).norm();
  });
  BodyJoints joints = without_fingers(body.joints);
  EXPECT_THAT(
      find_fingers(body.mesh, joints),
      ElementsAre(HasSubstr("the left hand moves as one piece: 4 of its fingers"), "the right hand has five fingers"));
  EXPECT_FALSE(has_fingers(joints, "left_"));
  EXPECT_TRUE(has_fingers(joints, "right_"));
}

TEST(FindFingers, KeepsFingersThatAreKnown) {
  const PosedBody body = posed_body({});
  BodyJoints joints = body.joints;
  EXPECT_TRUE(find_fingers(body.mesh, joints).empty());
  EXPECT_EQ(joints.positions, body.joints.positions);
}

TEST(FindFingers, BearsAMeshThatIsNotThere) {
  BodyJoints joints = support::plain_body();
  complete_joints(joints);
  EXPECT_THAT(find_fingers(TriangleMesh{}, joints), Each(HasSubstr("0 of its fingers")));
}

TEST(FindFingers, TheSkeletonKnowsHowFarAForearmIsRolled) {
  for (const double roll : {0.0, 0.6, 1.2, -0.8}) {
    const PosedBody body = posed_body({{"LeftForeArmRoll_rx", roll}});
    const BodySkeleton skeleton = make_body_skeleton(body.joints);
    const auto rest = [&](const char* dof) {
      return skeleton.rest_dofs[static_cast<std::size_t>(skeleton.skeleton.find_dof(dof).value())];
    };
    // The knuckles are not exactly level in the body's own rest pose.
    EXPECT_NEAR(rest("LeftForeArmRoll_rx"), roll, 0.1) << roll;
    EXPECT_EQ(rest("RightForeArmRoll_rx"), 0.0);
  }
}

class RealFingers : public support::SharedFolderTest {};

TEST_F(RealFingers, OfMakeHumansBodiesLieNearTheirOwnJoints) {
  std::vector<double> errors;
  for (const char* name : {"mh_girl_dress", "mh_man_old_suit", "mh_man_workwear", "mh_woman_slim"}) {
    const support::RiggedBody body = support::read_rigged_body(shared_ / "bodies", name);
    std::map<std::string, Vector3d> ground_truth;
    for (const auto& joint : body.ground_truth["joints"])
      ground_truth[joint["name"].get<std::string>().substr(std::string("mixamorig:").size())] =
          Vector3d(joint["position"][0], joint["position"][1], joint["position"][2]);
    BodyJoints joints = body.joints;
    complete_joints(joints);
    find_fingers(body.mesh, joints);
    for (const char* side : kSides) {
      ASSERT_TRUE(has_fingers(joints, side)) << name;
      const double forearm = (joints.at(side + std::string("wrist")) - joints.at(side + std::string("elbow"))).norm();
      for (const Finger& finger : kFingers)
        for (int k = 1; k <= kFingerBones; ++k)
          errors.push_back(
              (joints.at(finger_point(side, finger, k)) - ground_truth.at(finger_bone(side, finger, k))).norm() /
              forearm);
    }
  }
  // That rig has its knuckles up to a third of a phalanx nearer to the tip than bones have. Shares of a forearm, which
  // is 250 mm long in an adult.
  EXPECT_LT(250.0 * median(errors), 9.0);
  EXPECT_LT(250.0 * *std::max_element(errors.begin(), errors.end()), 18.0);
}

}  // namespace
}  // namespace doppel::find_fingers_test
