#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "doppel/core/error.h"
#include "doppel/rigging/autorig/create_character.h"
#include "rigging/scan/figures.h"
#include "support/message_of.h"

namespace doppel::refused_scans_test {
namespace {

using support::make_figure;
using support::message_of;

const Eigen::Vector3d kLeftHand(0.3, -0.45, 0), kRightHand(-0.3, -0.45, 0);

/// What `doppel character create` says about a scan of one part, in metres with y up.
std::string refusal_of(const TriangleMesh& mesh) {
  CreateCharacterOptions options;
  options.orientation.unit = "m";
  options.orientation.up = "y";
  return message_of<Error>([&] { create_character("actor", {{{"body", mesh}}}, options); });
}

TEST(RefusedScans, NoSurface) {
  EXPECT_EQ(message_of<Error>([] { create_character("actor", {}); }),
            "joining the parts of the scan: the file holds no surface; export the scan as a mesh");
  TriangleMesh points = make_figure(kLeftHand, kRightHand);
  points.faces.clear();
  EXPECT_EQ(
      refusal_of(points),
      "joining the parts of the scan: body: found 1944 vertices but no triangles; a surface is needed, so let the "
      "scanning program make a mesh of the points");
}

TEST(RefusedScans, ASheetWithoutVolume) {
  const std::string flat_message =
      "finding the orientation of the scan: all triangles lie in one plane, so there is no body; a scan of the person "
      "from all sides is needed";
  EXPECT_EQ(refusal_of(support::make_disc(0.0, 0.9)), flat_message);
  TriangleMesh flat = make_figure(kLeftHand, kRightHand);
  for (Eigen::Vector3d& vertex : flat.vertices) vertex.z() = 0.5 * vertex.x() + 0.25 * vertex.y();
  EXPECT_EQ(refusal_of(flat), flat_message);
}

TEST(RefusedScans, NumbersThatAreNone) {
  for (const double number : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    TriangleMesh figure = make_figure(kLeftHand, kRightHand);
    for (Eigen::Vector3d& vertex : figure.vertices) vertex.x() = number;
    EXPECT_EQ(refusal_of(figure),
              "finding the orientation of the scan: no triangle has finite corners; check the file");
  }
}

/// The joints of make_figure with the given hands.
BodyJoints joints_of_figure(const Eigen::Vector3d& left_hand, const Eigen::Vector3d& right_hand) {
  BodyJoints joints;
  for (const double side : {1.0, -1.0}) {
    const std::string name = side > 0 ? "left_" : "right_";
    const Eigen::Vector3d shoulder(side * 0.2, 1.40, 0.0), hand = side > 0 ? left_hand : right_hand;
    joints.positions[name + "shoulder"] = shoulder;
    joints.positions[name + "elbow"] = shoulder + 0.5 * hand;
    joints.positions[name + "wrist"] = shoulder + hand;
    joints.positions[name + "hip"] = {side * 0.09, 0.9, 0.0};
    joints.positions[name + "knee"] = {side * 0.1, 0.5, 0.0};
    joints.positions[name + "ankle"] = {side * 0.11, 0.05, -0.02};
  }
  complete_joints(joints);
  return joints;
}

std::vector<std::string> notes_on_arms(const Eigen::Vector3d& left_hand, const Eigen::Vector3d& right_hand) {
  const SolidGrid solid = solid_grid(VoxelSolid(make_figure(left_hand, right_hand)));
  return touching_arms(joints_of_figure(left_hand, right_hand), solid);
}

TEST(RefusedScans, AnArmThatTouchesTheTrunkIsNoted) {
  EXPECT_TRUE(notes_on_arms(kLeftHand, kRightHand).empty()) << "arms away from the trunk";
  EXPECT_TRUE(notes_on_arms({0.5, 0, 0}, {-0.5, 0, 0}).empty()) << "a T-pose";
  const auto notes = notes_on_arms({-0.02, -0.45, 0}, kRightHand);
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_EQ(notes[0],
            "the left arm touches the trunk, so both are one surface there and bend as one; scan the person again with "
            "the arms away from the trunk");
}

TEST(RefusedScans, BodiesThatDoNotTouch) {
  TriangleMesh two = make_figure(kLeftHand, kRightHand);
  TriangleMesh other = make_figure(kLeftHand, kRightHand);
  for (Eigen::Vector3d& vertex : other.vertices) vertex.x() += 2.0;
  support::append(two, other);
  EXPECT_EQ(refusal_of(two),
            "the scan holds several bodies that do not touch; the largest has 50 % of their surface. Cut the scan so "
            "that one person is left");
}

}  // namespace
}  // namespace doppel::refused_scans_test
