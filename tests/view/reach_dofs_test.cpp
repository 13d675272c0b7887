#include "doppel/view/reach_dofs.h"

#include <gtest/gtest.h>

#include <set>

#include "support/test_character.h"

namespace doppel::reach_dofs_test {
namespace {

std::set<std::string> names(const Skeleton& skeleton, int joint) {
  std::set<std::string> found;
  for (const ReachDof& reached : reach_dofs(skeleton, joint)) {
    EXPECT_GT(reached.radians, 0.0);
    found.insert(skeleton.dofs[static_cast<std::size_t>(reached.dof)].name);
  }
  return found;
}

TEST(ReachDofs, LeaveTheTrunkAndOtherLimbs) {
  Skeleton skeleton = make_test_character().skeleton;
  const int trunk = *skeleton.find_joint("Seg1_rx"), hand = skeleton.num_joints() - 1;
  const std::set<std::string> of_the_chain = names(skeleton, hand);
  skeleton.joints.push_back(
      {"Side", Joint::Type::revolute, trunk, Eigen::Vector3d(0.1, 0.0, 0.0), Eigen::Vector3d::UnitX()});
  const std::set<std::string> of_the_limb = names(skeleton, hand);
  EXPECT_TRUE(of_the_limb.contains("lean_2"));
  for (const std::string& name : of_the_limb) {
    EXPECT_FALSE(name.starts_with("translate_") || name.starts_with("rotate_")) << name;
    EXPECT_TRUE(of_the_chain.contains(name)) << name;
  }
  EXPECT_GT(of_the_chain.size(), of_the_limb.size()) << "without a branch, only the root is the trunk";
  EXPECT_TRUE(names(skeleton, skeleton.num_joints() - 1).empty()) << "the side branch hangs on the trunk";
  EXPECT_TRUE(names(skeleton, 0).empty());
}

}  // namespace
}  // namespace doppel::reach_dofs_test
