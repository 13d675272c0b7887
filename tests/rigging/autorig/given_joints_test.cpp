#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>

#include "doppel/rigging/autorig/create_character.h"
#include "rigging/scan/figures.h"
#include "support/temporary_folder.h"

namespace doppel::given_joints_test {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const Eigen::Vector3d kHand(0.3, -0.45, 0);

/// The joints of make_figure with kHand on both sides.
BodyJoints joints_of_figure() {
  BodyJoints joints;
  for (const double side : {1.0, -1.0}) {
    const std::string name = side > 0 ? "left_" : "right_";
    const Eigen::Vector3d shoulder(side * 0.2, 1.40, 0.0), hand(side * kHand.x(), kHand.y(), kHand.z());
    joints.positions[name + "shoulder"] = shoulder;
    joints.positions[name + "elbow"] = shoulder + 0.5 * hand;
    joints.positions[name + "wrist"] = shoulder + hand;
    joints.positions[name + "hip"] = {side * 0.09, 0.9, 0.0};
    joints.positions[name + "knee"] = {side * 0.1, 0.5, 0.0};
    joints.positions[name + "ankle"] = {side * 0.11, 0.05, -0.02};
  }
  return joints;
}

BodyJoints swapped(const BodyJoints& joints) {
  BodyJoints result;
  for (const auto& [name, position] : joints.positions) result.positions[other_side(name)] = position;
  return result;
}

class GivenJoints : public ::testing::Test {
 protected:
  /// The character of the figure in centimetres with z up. @param matrix that stands in the file of joints
  CreatedCharacter create(const BodyJoints& in_metres, const Eigen::Affine3d& matrix) const {
    TriangleMesh mesh = support::make_figure(kHand, {-kHand.x(), kHand.y(), kHand.z()});
    for (Eigen::Vector3d& vertex : mesh.vertices) vertex = scan_ * vertex;
    JointsFile file{matrix, in_metres};
    for (auto& [name, position] : file.joints.positions) position = matrix.inverse() * (scan_ * position);
    write_joints(folder_ / "joints.json", file);
    CreateCharacterOptions options;
    options.joints = folder_ / "joints.json";
    options.nodes = 60;
    options.cell = 0.02;
    return create_character("actor", {{{"body", mesh}}}, options);
  }

  support::TemporaryFolder folder_;
  Eigen::Affine3d scan_ =
      Eigen::Affine3d(Eigen::Scaling(100.0)) * Eigen::AngleAxisd(0.5 * std::numbers::pi, Eigen::Vector3d::UnitX());
};

TEST_F(GivenJoints, LieInTheCoordinatesOfTheScanWhateverMatrixTheirFileHas) {
  const BodyJoints joints = joints_of_figure();
  for (const Eigen::Affine3d& matrix : {Eigen::Affine3d(scan_), Eigen::Affine3d(Eigen::Scaling(1000.0))}) {
    const CreatedCharacter created = create(joints, matrix);
    EXPECT_THAT(created.doubts, IsEmpty());
    EXPECT_FALSE(created.joint_sheet.empty());
    for (const auto& [name, position] : joints.positions)
      EXPECT_LT((created.joints.joints.at(name) - position).norm(), 0.02) << name;  // the frame's origin is the middle
  }
}

TEST_F(GivenJoints, SwappedSidesAndJointsOutsideOfTheBodyAreDoubted) {
  BodyJoints joints = joints_of_figure();
  EXPECT_THAT(create(swapped(joints), scan_).doubts, Contains(HasSubstr("left and right are swapped")));
  for (auto& [name, position] : joints.positions) position.z() += 0.5;
  EXPECT_THAT(create(joints, scan_).doubts, Contains(HasSubstr("12 of the 12 joints of the limbs lie outside")));
}

}  // namespace
}  // namespace doppel::given_joints_test
