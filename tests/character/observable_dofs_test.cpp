#include "doppel/character/observable_dofs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "support/test_character.h"

namespace doppel::observable_dofs_test {
namespace {

using Names = std::vector<std::string>;

const Character& tube() {
  static const Character character = make_test_character(5);
  return character;
}

/// A landmark on segment i, `across` metres beside its axis.
Marker landmark(int i, double across) {
  return {"landmark_" + std::to_string(i), test_character::segment_joint(i), {across, 0.0, 0.0}, 0.01};
}

Names names_of(const std::vector<int>& dofs) {
  Names names;
  for (const int dof : dofs) names.push_back(tube().skeleton.dofs[dof].name);
  return names;
}

const Names kOfRoot{"translate_x", "translate_y", "translate_z", "rotate_y", "rotate_z", "rotate_x"};

TEST(ObservableDofs, RotateTheJointOfALandmarkOrAJointAbove) {
  const std::vector<Marker> landmarks{landmark(0, 0.07), landmark(1, 0.07), landmark(2, 0.07)};
  Names expected = kOfRoot;
  for (const char* name : {"bend", "lean_1", "flex_1", "lean_2", "flex_2", "twist_2"}) expected.push_back(name);
  EXPECT_EQ(names_of(observable_dofs(tube().skeleton, landmarks)), expected);
}

TEST(JointAngles, AreAllRotationsAndNoSizes) {
  const Names names = names_of(joint_angles(tube().skeleton));
  const auto has = [&](const char* name) { return std::count(names.begin(), names.end(), name) == 1; };
  for (const char* angle : {"rotate_x", "bend", "twist_2", "twist_4", "lean_4"}) EXPECT_TRUE(has(angle)) << angle;
  EXPECT_FALSE(has("translate_x"));
  for (const int dof : joint_angles(tube().skeleton))
    for (const Dof::Drive& drive : tube().skeleton.dofs[dof].joints)
      EXPECT_EQ(tube().skeleton.joints[drive.joint].type, Joint::Type::revolute);
}

TEST(DeterminedDofs, HaveALeverToALandmark) {
  const auto determined = [](const std::vector<Marker>& landmarks) {
    return names_of(determined_dofs(tube().skeleton, landmarks, tube().rest_dofs));
  };
  // The landmark stands in the centre of segment 2's rotations.
  Names expected = kOfRoot;
  for (const char* name : {"bend", "lean_1", "flex_1"}) expected.push_back(name);
  EXPECT_EQ(determined({landmark(2, 0.0)}), expected);
  // In the rest pose, segments 2 and 3 are in a line; bent, the twist moves the end of segment 3.
  const Names bent = determined({landmark(4, 0.0)});
  EXPECT_EQ(std::count(bent.begin(), bent.end(), "twist_2"), 1);
  EXPECT_EQ(std::count(bent.begin(), bent.end(), "twist_4"), 0);
  EXPECT_EQ(std::count(bent.begin(), bent.end(), "flex_3"), 1);
  // Beside the axis, all of segment 2's own rotations count.
  const Names beside = determined({landmark(2, 0.07)});
  for (const char* name : {"lean_2", "twist_2"}) EXPECT_EQ(std::count(beside.begin(), beside.end(), name), 1) << name;
}

}  // namespace
}  // namespace doppel::observable_dofs_test
