#include "doppel/track/livecap/pose_prior.h"

#include <gtest/gtest.h>

#include "support/message_of.h"
#include "track/energy/body_fixture.h"

namespace doppel::pose_prior_test {
namespace {

TEST(PosePrior, HasMeanAndCovarianceOfTheJointAngles) {
  const Character character = make_test_character(4);
  const PoseModel model(character, tube_landmarks(4), all_dofs(character));
  std::vector<double> first = character.rest_dofs, second = character.rest_dofs;
  first[0] += 5.0;  // the root's position says nothing
  first[6] += 0.3;
  second[6] -= 0.1;
  second[7] += 0.2;
  const PosePrior prior = learn_pose_prior(model, {first, second}, 0.05);
  EXPECT_DOUBLE_EQ(prior.mean[0], character.rest_dofs[0]);
  EXPECT_NEAR(prior.mean[6], character.rest_dofs[6] + 0.1, 1e-12);
  int sixth = 0, seventh = 0, root = 0;
  while (model.dof_of(sixth) != 6) ++sixth;
  while (model.dof_of(seventh) != 7) ++seventh;
  while (model.dof_of(root) != 0) ++root;
  EXPECT_NEAR(prior.covariance(sixth, sixth), 0.04 + std::pow(0.05 / model.reach(6), 2), 1e-12);
  EXPECT_NEAR(prior.covariance(sixth, seventh), -0.02, 1e-12);
  EXPECT_GT(prior.covariance(root, root), 1e6) << "the root is free";
}

TEST(PosePrior, RejectsPosesOfAnotherSkeleton) {
  const Character character = make_test_character(4);
  const PoseModel model(character, tube_landmarks(4), all_dofs(character));
  EXPECT_NE(support::message_of([&] { learn_pose_prior(model, {{1.0, 2.0}}, 0.1); }).find("2 DoFs"), std::string::npos);
  EXPECT_NE(support::message_of([&] { learn_pose_prior(model, {}, 0.1); }).find("at least one"), std::string::npos);
}

}  // namespace
}  // namespace doppel::pose_prior_test
