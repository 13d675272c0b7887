#include "doppel/view/inverse_kinematics.h"

#include <gtest/gtest.h>
#include <torch/types.h>

#include "doppel/core/error.h"
#include "doppel/layers/kinematics/kinematics.h"
#include "support/test_character.h"

namespace doppel::inverse_kinematics_test {
namespace {

/// The chain of the test character with a second branch at its first segment, where the trunk ends.
Character branched() {
  Character character = make_test_character();
  const int trunk = *character.skeleton.find_joint("Seg1_rx");
  character.skeleton.joints.push_back(
      {"Side", Joint::Type::revolute, trunk, Eigen::Vector3d(0.1, 0.0, 0.0), Eigen::Vector3d::UnitX()});
  return character;
}

/// The position of a joint by forward kinematics, world metres.
Eigen::Vector3d position(const Character& character, const std::vector<double>& dofs, int joint) {
  Kinematics kinematics(character);
  const torch::Tensor at =
      kinematics->joints(torch::tensor(dofs, torch::kFloat64).unsqueeze(0))[0][joint].select(-1, 3).contiguous();
  return Eigen::Map<const Eigen::Vector3d>(at.data_ptr<double>());
}

/// The last joint of the chain, not the side branch.
int hand(const Character& character) { return character.skeleton.num_joints() - 2; }

TEST(InverseKinematics, ReachesWhereAnotherPosePutsTheJoint) {
  const Character character = branched();
  std::vector<double> other = character.rest_dofs;
  for (std::size_t d = 0; d < other.size(); ++d) {
    const std::string& name = character.skeleton.dofs[d].name;
    if (name == "lean_2" || name == "flex_2") other[d] += 0.3;
  }
  const Eigen::Vector3d target = position(character, other, hand(character));
  ASSERT_GT((target - position(character, character.rest_dofs, hand(character))).norm(), 0.02);
  const ReachResult result = reach(character, character.rest_dofs, hand(character), target);
  const double left = (position(character, result.dofs, hand(character)) - target).norm();
  EXPECT_LT(left, 0.01);
  EXPECT_NEAR(result.distance, left, 1e-9);
}

TEST(InverseKinematics, KeepsTheWholeBodyAndTheLimitsWhenTheTargetIsFarAway) {
  const Character character = branched();
  const ReachResult result = reach(character, character.rest_dofs, hand(character), {5.0, 0.0, 0.0});
  EXPECT_GT(result.distance, 1.0);
  for (std::size_t d = 0; d < result.dofs.size(); ++d) {
    const Dof& dof = character.skeleton.dofs[d];
    const bool of_the_body = dof.name.starts_with("translate_") || dof.name.starts_with("rotate_");
    EXPECT_TRUE(!of_the_body || result.dofs[d] == character.rest_dofs[d]) << dof.name;
    if (!dof.limits || result.dofs[d] == character.rest_dofs[d]) continue;
    EXPECT_GE(result.dofs[d], (*dof.limits)[0]) << dof.name;
    EXPECT_LE(result.dofs[d], (*dof.limits)[1]) << dof.name;
  }
}

TEST(InverseKinematics, RefusesWrongInputs) {
  const Character character = branched();
  EXPECT_THROW(reach(character, {0.0}, 0, {0, 0, 0}), UsageError);
  EXPECT_THROW(reach(character, character.rest_dofs, -1, {0, 0, 0}), UsageError);
  EXPECT_THROW(reach(character, character.rest_dofs, 0, {NAN, 0, 0}), UsageError);
}

}  // namespace
}  // namespace doppel::inverse_kinematics_test
