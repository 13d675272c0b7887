#include "doppel/character/skeleton.h"

#include <gmock/gmock.h>

#include "doppel/character/dof_names.h"
#include "doppel/core/error.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "support/test_character.h"

namespace doppel::skeleton_test {
namespace {

using support::replaced;
using ::testing::HasSubstr;

constexpr char kArm[] =
    "Skeletool Skeleton Definition V1.0\n"
    "joints: 4\n"
    "  Root_tx   prismatic none     10  0   0   2 0 0  1.0\n"
    "  Root_ry   revolute  Root_tx  0   0   0   0 5 0  1.0\n"
    "  Arm_rz    revolute  Root_ry  75  20  0   0 0 1  2.0\n"
    "  ArmEE     revolute  Arm_rz   300 0   0   0 1 0  1.0\n"
    "markers: 2\n"
    "  wrist     Arm_rz    point    250 5   0   20  1 0 0\n"
    "  tip       ArmE      point    0 0 10\n"
    "scaling joints: 0\n"
    "dofs: 4\n"
    "  walk_x    1\n"
    "      nolimits\n"
    "      Root_tx   1000\n"
    "  turn      1\n"
    "      nolimits\n"
    "      Root_ry   3\n"
    "  lift      2\n"
    "      limits   -1.2  1.2\n"
    "      Arm_rz    0.5\n"
    "      Root_r    0.25\n"
    "  nothing   0\n"
    "      limits   -10 10\n"
    "textureEntries: 0\n";

class SkeletonFile : public ::testing::Test {
 protected:
  Skeleton read(const std::string& text, MarkerReading reading = MarkerReading::joint_relative) {
    support::write_bytes(path_, text);
    return read_skeleton(path_, reading);
  }
  /// The message with which a file is refused.
  std::string refusal(const std::string& text) {
    return support::message_of<FileError>([&] { read(text); });
  }
  support::TemporaryFolder folder_;
  std::filesystem::path path_ = folder_.path() / "arm.skeleton";
};
using SkeletonReads = SkeletonFile;
using SkeletonRejects = SkeletonFile;
using SkeletonWrites = SkeletonFile;

TEST_F(SkeletonReads, MillimetresBecomeMetresAndScaleIsMultipliedIn) {
  const Skeleton s = read(kArm);
  ASSERT_EQ(s.num_joints(), 4);
  EXPECT_DOUBLE_EQ(s.joints[0].offset.x(), 0.010);
  EXPECT_DOUBLE_EQ(s.joints[0].axis.x(), 0.002);  // prismatic: not normalised
  EXPECT_DOUBLE_EQ(s.joints[1].axis.y(), 1.0);    // revolute: normalised
  EXPECT_DOUBLE_EQ(s.joints[2].offset.x(), 0.150);
  EXPECT_EQ(s.joints[3].parent, 2);
  EXPECT_DOUBLE_EQ(s.markers[0].position.x(), 0.250);
  EXPECT_DOUBLE_EQ(s.markers[0].size, 0.020);
}

TEST_F(SkeletonReads, NamesAreFoundByPrefixWhenNoneIsExact) {
  const Skeleton s = read(kArm);
  EXPECT_EQ(s.markers[1].joint, 3);
  EXPECT_EQ(s.dofs[2].joints[1].joint, 1);
}

TEST_F(SkeletonReads, DofsKeepWeightsLimitsAndMayDriveNothing) {
  const Skeleton s = read(kArm);
  ASSERT_EQ(s.num_dofs(), 4);
  EXPECT_FALSE(s.dofs[0].limits);
  EXPECT_DOUBLE_EQ((*s.dofs[2].limits)[0], -1.2);
  EXPECT_DOUBLE_EQ(s.dofs[2].joints[0].weight, 0.5);
  EXPECT_TRUE(s.dofs[3].joints.empty());
  EXPECT_EQ(s.find_dof("turn"), 1);
  EXPECT_EQ(s.find_dof("tur"), std::nullopt);
}

TEST_F(SkeletonReads, DofsAreFoundByPatterns) {
  Skeleton s = read(kArm);
  for (const char* name : {"lean_1", "lean_12", "*", ""}) {
    s.dofs.emplace_back();
    s.dofs.back().name = name;
  }
  using Found = std::vector<int>;
  EXPECT_EQ(find_dofs(s, "turn"), Found{1});
  EXPECT_EQ(find_dofs(s, "lean_*"), (Found{4, 5}));
  EXPECT_EQ(find_dofs(s, "*n*_1"), Found{4});
  EXPECT_EQ(find_dofs(s, "*1*2"), Found{5});
  EXPECT_EQ(find_dofs(s, "lean_?"), Found{}) << "only * stands for something else";
  EXPECT_EQ(find_dofs(s, ""), Found{7});
  EXPECT_EQ(find_dofs(s, "**").size(), 8u);
}

TEST_F(SkeletonReads, WindowsLineEndsChangeNothing) {
  std::string windows;
  for (const char c : std::string(kArm)) windows += c == '\n' ? std::string("\r\n") : std::string(1, c);
  const Skeleton unix_file = read(kArm), windows_file = read(windows);
  ASSERT_EQ(windows_file.num_joints(), unix_file.num_joints());
  for (int j = 0; j < unix_file.num_joints(); ++j) EXPECT_EQ(windows_file.joints[j].name, unix_file.joints[j].name);
  EXPECT_EQ(windows_file.dofs[3].name, "nothing");
}

TEST_F(SkeletonReads, AJointBeforeItsParentMovesBehindIt) {
  const std::string root = "  Root_tx   prismatic none     10  0   0   2 0 0  1.0\n";
  const std::string arm_end = "  ArmEE     revolute  Arm_rz   300 0   0   0 1 0  1.0\n";
  const Skeleton ordered = read(kArm);
  const Skeleton shuffled = read(replaced(replaced(kArm, arm_end, ""), root, arm_end + root));
  ASSERT_EQ(shuffled.num_joints(), 4);
  EXPECT_EQ(shuffled.file_order, (std::vector<int>{3, 0, 1, 2}));
  const std::vector<double> dofs{0.1, 0.2, 0.3, 0.4};
  const auto a = ordered.pose(dofs), b = shuffled.pose(dofs);
  for (int j = 0; j < 4; ++j) {
    EXPECT_EQ(shuffled.joints[j].name, ordered.joints[j].name);
    EXPECT_LT(shuffled.joints[j].parent, j);
    EXPECT_EQ(a[j].matrix(), b[j].matrix());
  }
  // The last joint of the file is what counts for bones, wherever the reordering puts it.
  EXPECT_EQ(ordered.joint_of_bone("Arm", BoneRule::prefix), 3);
  EXPECT_EQ(shuffled.joint_of_bone("Arm", BoneRule::prefix), 2);
}

TEST_F(SkeletonReads, BonesGoToTheLastJointByEitherRule) {
  const Skeleton s = read(kArm);
  EXPECT_EQ(s.joint_of_bone("Root", BoneRule::exact), 1);
  EXPECT_EQ(s.joint_of_bone("Arm", BoneRule::exact), 2);
  EXPECT_EQ(s.joint_of_bone("Arm", BoneRule::prefix), 3);
  EXPECT_EQ(s.joint_of_bone("ArmEE", BoneRule::exact), 3);
  EXPECT_THROW(s.joint_of_bone("Leg", BoneRule::exact), Error);
  EXPECT_THROW(s.joint_of_bone("Leg", BoneRule::prefix), Error);
}

TEST_F(SkeletonReads, MarkersInTheWorldOfTheZeroPose) {
  const Skeleton s = read(kArm, MarkerReading::zero_pose_world);
  EXPECT_EQ(s.marker_reading, MarkerReading::zero_pose_world);
  const auto zero = s.pose({0.0, 0.0, 0.0, 0.0});
  EXPECT_NEAR((zero[2] * s.markers[0].position - Eigen::Vector3d(0.250, 0.005, 0.0)).norm(), 0.0, 1e-15);
  EXPECT_NEAR((marker_to_file(s, s.markers[0], s.marker_reading) - Eigen::Vector3d(0.250, 0.005, 0.0)).norm(), 0.0,
              1e-15);
}

TEST(SkeletonReference, PoseOfAHandComputedArm) {
  support::TemporaryFolder folder;
  support::write_bytes(folder.path() / "arm.skeleton", kArm);
  const Skeleton s = read_skeleton(folder.path() / "arm.skeleton");
  // walk 0.5 -> 500 units of 2 mm = 1 m; heading 3 * turn + 0.25 * lift = pi/2; arm 0.5 * lift = 0.25.
  const double turn = (M_PI / 2.0 - 0.25 * 0.5) / 3.0;
  const auto a = s.pose({0.5, turn, 0.5, 7.0});
  EXPECT_NEAR((a[0].translation() - Eigen::Vector3d(1.01, 0.0, 0.0)).norm(), 0.0, 1e-15);
  // The shoulder offset (0.15, 0.04, 0) turned by 90 degrees about y points along -z.
  EXPECT_NEAR((a[2].translation() - Eigen::Vector3d(1.01, 0.04, -0.15)).norm(), 0.0, 1e-14);
  const Eigen::Vector3d end(1.01, 0.04 + 0.3 * std::sin(0.25), -0.15 - 0.3 * std::cos(0.25));
  EXPECT_NEAR((a[3].translation() - end).norm(), 0.0, 1e-14);
}

TEST(SkeletonReference, PoseRejectsAnotherNumberOfDofs) {
  const Character character = make_test_character();
  EXPECT_THROW(character.skeleton.pose({1.0}), Error);
}

TEST(SkeletonReference, RootOfACapturyLikeSkeleton) {
  const Character character = make_test_character();
  const Skeleton::Root root = character.skeleton.root();
  EXPECT_EQ(root.translation, (std::array<int, 3>{0, 1, 2}));
  EXPECT_EQ(root.rotation, (std::array<int, 3>{3, 4, 5}));
  EXPECT_EQ(root.axes, (std::array<int, 3>{1, 2, 0}));
  for (int i = 0; i < 3; ++i) {
    EXPECT_DOUBLE_EQ(root.translation_weight[i], 1.0);
    EXPECT_DOUBLE_EQ(root.rotation_weight[i], 3.0);
  }
}

TEST(SkeletonReference, RootOfAnotherOrderWithDofsShuffledAndNegativeAxes) {
  Character character = make_test_character();
  Skeleton& s = character.skeleton;
  // VNect-like: rx ry rz; the DoF list in another order; y downwards.
  const std::array<Eigen::Vector3d, 3> axes{Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY(),
                                            Eigen::Vector3d::UnitZ()};
  for (int i = 0; i < 3; ++i) s.joints[3 + i].axis = axes[i];
  s.joints[1].axis = Eigen::Vector3d(0.0, -0.001, 0.0);
  std::swap(s.dofs[0], s.dofs[7]);
  std::swap(s.dofs[3], s.dofs[5]);
  const Skeleton::Root root = s.root();
  EXPECT_EQ(root.translation, (std::array<int, 3>{7, 1, 2}));
  EXPECT_EQ(root.rotation, (std::array<int, 3>{5, 4, 3}));
  EXPECT_EQ(root.axes, (std::array<int, 3>{0, 1, 2}));
  EXPECT_DOUBLE_EQ(root.translation_weight[1], -1.0);
}

TEST(SkeletonRejectsRoot, WhatIsNotThreeTranslationsAndThreeRotations) {
  const Character character = make_test_character();
  Skeleton turned = character.skeleton;
  turned.joints[0].type = Joint::Type::revolute;
  EXPECT_THROW(turned.root(), Error);
  Skeleton twice = character.skeleton;
  twice.joints[4].axis = twice.joints[3].axis;
  EXPECT_THROW(twice.root(), Error);
  Skeleton skewed = character.skeleton;
  skewed.joints[3].axis = Eigen::Vector3d(0.6, 0.8, 0.0);
  EXPECT_THROW(skewed.root(), Error);
  Skeleton shared = character.skeleton;
  shared.dofs[6].joints.push_back({3, 1.0});
  EXPECT_THROW(shared.root(), Error);
}

TEST_F(SkeletonWrites, WhatIsReadBackIsTheSameToTheLastDigit) {
  const Skeleton written = make_test_character().skeleton;
  write_skeleton(path_, written);
  const Skeleton read_back = read_skeleton(path_);
  ASSERT_EQ(read_back.num_joints(), written.num_joints());
  for (int j = 0; j < written.num_joints(); ++j) {
    EXPECT_EQ(read_back.joints[j].name, written.joints[j].name);
    EXPECT_EQ(read_back.joints[j].type, written.joints[j].type);
    EXPECT_EQ(read_back.joints[j].parent, written.joints[j].parent);
    EXPECT_EQ(read_back.joints[j].offset, written.joints[j].offset);
    EXPECT_EQ(read_back.joints[j].axis, written.joints[j].axis);
  }
  ASSERT_EQ(read_back.num_dofs(), written.num_dofs());
  for (int d = 0; d < written.num_dofs(); ++d) {
    EXPECT_EQ(read_back.dofs[d].name, written.dofs[d].name);
    EXPECT_EQ(read_back.dofs[d].limits, written.dofs[d].limits);
    ASSERT_EQ(read_back.dofs[d].joints.size(), written.dofs[d].joints.size());
    for (std::size_t i = 0; i < written.dofs[d].joints.size(); ++i) {
      EXPECT_EQ(read_back.dofs[d].joints[i].joint, written.dofs[d].joints[i].joint);
      EXPECT_EQ(read_back.dofs[d].joints[i].weight, written.dofs[d].joints[i].weight);
    }
  }
  ASSERT_EQ(read_back.markers.size(), written.markers.size());
  for (std::size_t m = 0; m < written.markers.size(); ++m) {
    EXPECT_EQ(read_back.markers[m].position, written.markers[m].position);
    EXPECT_EQ(read_back.markers[m].size, written.markers[m].size);
    EXPECT_EQ(read_back.markers[m].joint, written.markers[m].joint);
  }
}

TEST_F(SkeletonWrites, AReorderedFileKeepsItsOrder) {
  const std::string root = "  Root_tx   prismatic none     10  0   0   2 0 0  1.0\n";
  const std::string arm_end = "  ArmEE     revolute  Arm_rz   300 0   0   0 1 0  1.0\n";
  const Skeleton first = read(replaced(replaced(kArm, arm_end, ""), root, arm_end + root));
  write_skeleton(path_, first);
  EXPECT_EQ(read_skeleton(path_).file_order, first.file_order);
}

TEST_F(SkeletonWrites, NumbersThatCouldNotBeReadBackAreRefused) {
  Skeleton skeleton = make_test_character().skeleton;
  skeleton.joints[2].offset.x() = std::nan("");
  EXPECT_THROW(write_skeleton(path_, skeleton), Error);
  EXPECT_FALSE(std::filesystem::exists(path_));
}

TEST_F(SkeletonRejects, EachFaultWithItsLineAndReason) {
  const struct {
    const char *from, *to, *line, *reason;
  } faults[] = {
      {"V1.0", "V0.9", "skeleton:1:", "unsupported version"},
      {"Skeletool Skeleton Definition V1.0", "hello", "skeleton:1:", "not a skeleton file"},
      {"joints: 4", "joints: -4", "skeleton:2:", ""},
      {"joints: 4", "joints: 999999999999", "skeleton:2:", ""},
      {"joints: 4", "joints: 0", "skeleton:2:", "no joints"},
      {"joints: 4", "joints: 5", "skeleton:7:", "columns"},
      {"joints: 4", "joints: 3", "skeleton:6:", "markers:"},
      {"revolute  Root_tx", "hinge  Root_tx", "skeleton:4:", "hinge"},
      {"revolute  Root_tx", "revolute  Nobody", "skeleton:4:", "Nobody"},
      {"revolute  Root_tx", "revolute  none", "skeleton:4:", "second root"},
      {"prismatic none", "prismatic ArmEE", "skeleton:3:", "circle"},
      {"Root_ry   revolute", "Root_tx   revolute", "skeleton:4:", "twice"},
      {"0 5 0", "0 0 0", "skeleton:4:", "no direction"},
      {"75  20", "75  nan", "skeleton:5:", ""},
      {"75  20", "75  1e999", "skeleton:5:", ""},
      {"75  20", "75  x", "skeleton:5:", ""},
      {"point    250", "oriented 250", "skeleton:8:", "oriented"},
      {"point    250", "cloud 250", "skeleton:8:", "cloud"},
      {"250 5   0   20  1 0 0", "250 5   0   20  1", "skeleton:8:", "6, 7 or 10"},
      {"wrist     Arm_rz", "wrist     Leg", "skeleton:8:", "Leg"},
      {"dofs: 4", "dofs: 5", "skeleton:24:", ""},
      {"-1.2  1.2", "1.2  -1.2", "skeleton:19:", "above"},
      {"limits   -1.2  1.2", "limits   -1.2", "skeleton:19:", "columns"},
      {"limits   -1.2  1.2", "free", "skeleton:19:", "nolimits"},
      {"turn      1", "walk_x      1", "", "defined twice"},
      {"turn      1", "turn      -1", "skeleton:15:", ""},
      {"textureEntries: 0\n", "", "", "ends"},
      {"textureEntries: 0\n", "textureEntries: 0\nmore\n", "skeleton:25:", "unexpected"},
  };
  for (const auto& fault : faults) {
    const std::string message = refusal(replaced(kArm, fault.from, fault.to));
    EXPECT_THAT(message, HasSubstr(fault.line)) << fault.to;
    EXPECT_THAT(message, HasSubstr(fault.reason)) << fault.to;
    EXPECT_NE(message, "nothing was thrown") << fault.to;
  }
}

}  // namespace
}  // namespace doppel::skeleton_test
