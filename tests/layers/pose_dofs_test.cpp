#include "doppel/layers/pose_dofs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/script.h>

#include "doppel/core/error.h"
#include "doppel/layers/rotation_math.h"
#include "support/gradient_check.h"
#include "support/layer_inputs.h"
#include "support/message_of.h"
#include "support/test_character.h"

namespace doppel::pose_dofs_test {
namespace {

using support::message_of;
using namespace test;
using torch::Tensor;

PoseDofs pose_of(const std::vector<std::string>& patterns = {}) {
  return PoseDofs(test_actor().skeleton, patterns, test_actor().rest_dofs);
}
Tensor rest_dofs() { return torch::tensor(test_actor().rest_dofs, torch::kFloat64); }

const std::vector<std::array<int, 3>> kOrders{{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}};

TEST(RotationAngles, AreTheInverseForEveryOrder) {
  Tensor angles = random_numbers({20, 3}, 1).clamp(-3.1, 3.1);
  angles.select(1, 1).clamp_(-1.5, 1.5);
  for (const auto& axes : kOrders)
    EXPECT_TRUE(is_near(rotation_to_angles(angles_to_rotation(angles, axes), axes), angles, 1e-12));
}

TEST(RotationAngles, GiveTheRotationBackAtThePole) {
  for (const auto& axes : kOrders) {
    for (double pole : {M_PI / 2, -M_PI / 2}) {
      const Tensor rotation = angles_to_rotation(torch::tensor({{0.4, pole, -0.9}}, torch::kFloat64), axes);
      const Tensor leaf = test::leaf(rotation, torch::kFloat64);
      const Tensor angles = rotation_to_angles(leaf, axes);
      EXPECT_EQ(angles[0][0].item<double>(), 0.0);
      EXPECT_TRUE(is_near(angles_to_rotation(angles, axes), rotation, 2e-6));
      angles.sum().backward();
      EXPECT_TRUE(leaf.grad().isfinite().all().item<bool>());
    }
  }
}

TEST(RotationAngles, GradientEqualsCentralDifferences) {
  const Tensor rotation = angles_to_rotation(random_numbers({3, 3}, 4) * 0.7, {1, 2, 0});
  EXPECT_TRUE(gradients_match(
      [](const auto& x) {
        return rotation_to_angles(x[0], {1, 2, 0});
      },
      {{"rotation", rotation}}));
}

TEST(PoseDofs, TakesEveryDofThatMovesSomethingBesideTheRoot) {
  EXPECT_THAT(pose_of().names(),
              testing::ElementsAre("bend", "lean_1", "flex_1", "stretch", "lean_2", "flex_2", "twist_2", "lean_3",
                                   "flex_3", "twist_3", "lean_4", "flex_4", "twist_4"));
}

TEST(PoseDofs, ChoosesByPatternsInTheirOrder) {
  EXPECT_THAT(pose_of({"lean_*", "twist_3"}).names(),
              testing::ElementsAre("lean_1", "lean_2", "lean_3", "twist_3", "lean_4"));
  EXPECT_THAT(pose_of({"!*_3", "!*_4", "!*_2", "lean_3"}).names(),
              testing::ElementsAre("bend", "lean_1", "flex_1", "stretch", "lean_3"));
  EXPECT_THAT(message_of<UsageError>([] { pose_of({"lean_*", "leen_2"}); }), testing::HasSubstr("'leen_2'"));
  EXPECT_THAT(message_of<UsageError>([] {
                pose_of({"idle", "rotate_*"});
              }),
              testing::HasSubstr("none of the named DoFs"));
}

TEST(PoseDofs, MeasuresThetaAndItsLimitsInRadiansOfTheJointThatMovesMost) {
  const PoseDofs pose = pose_of({"bend", "flex_1", "twist_2"});
  // bend drives joints by 0.6 and -0.4 and has the limits -1.2 .. 1.2 of its own value; flex_1 has none.
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(is_near(pose.lower().index_select(0, torch::tensor({0, 2})), torch::tensor({-0.72, -0.75}), 1e-7));
  EXPECT_TRUE(is_near(pose.upper().index_select(0, torch::tensor({0, 2})), torch::tensor({0.72, 0.75}), 1e-7));
  EXPECT_EQ(pose.upper()[1].item<double>(), infinity);
  EXPECT_EQ(pose.lower()[1].item<double>(), -infinity);
  const double rest_flex = test_actor().rest_dofs[*test_actor().skeleton.find_dof("flex_1")];
  EXPECT_TRUE(is_near(pose.middle(), torch::tensor({0.0, 0.7 * rest_flex, 0.0}, torch::kFloat64), 1e-12));
}

TEST(PoseDofs, ReadsBackWhatItWrote) {
  const PoseDofs pose = pose_of({"lean_*", "flex_*"});
  const Tensor theta = random_numbers({4, pose.size()}, 1), position = 3.0 * random_numbers({4, 3}, 2);
  const Tensor rotation = test::random_transforms(4, 1, 0.0, 3).squeeze(1).narrow(-1, 0, 3);
  const Tensor dofs = pose.dofs(theta, rotation, position);
  EXPECT_TRUE(is_near(pose.theta(dofs), theta, 1e-12));
  EXPECT_TRUE(is_near(pose.rotation(dofs), rotation, 1e-12));
  EXPECT_TRUE(is_near(pose.position(dofs), position, 1e-12));
  for (const char* given : {"bend", "idle", "stretch", "twist_2"}) {
    const int64_t d = *test_actor().skeleton.find_dof(given);
    EXPECT_TRUE(is_near(dofs.select(1, d), rest_dofs()[d].expand({4}), 0.0, 1e-15)) << given;
  }
}

TEST(PoseDofs, PutsTheRootWhereItIsTold) {
  const PoseDofs pose = pose_of();
  const Tensor theta = 0.3 * random_numbers({1, pose.size()}, 1), position = random_numbers({1, 3}, 2);
  const Tensor rotation = test::random_transforms(1, 1, 0.0, 3).squeeze(1).narrow(-1, 0, 3);
  const auto joints = [&](const Tensor& dofs) {
    const double* row = dofs.data_ptr<double>();
    return test_actor().skeleton.pose(std::vector<double>(row, row + dofs.numel()));
  };
  const auto moved = joints(pose.dofs(theta, rotation, position)), still = joints(pose.root_relative(theta));
  Eigen::Affine3d world_from_root = Eigen::Affine3d::Identity();
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) world_from_root(r, c) = rotation[0][r][c].item<double>();
    world_from_root(r, 3) = position[0][r].item<double>();
  }
  for (size_t j = 5; j < moved.size(); ++j)
    EXPECT_TRUE(moved[j].isApprox(world_from_root * still[j], 1e-12)) << "joint " << j;
}

TEST(PoseDofs, GradientEqualsCentralDifferences) {
  const PoseDofs pose = pose_of();
  const Tensor rotation = test::random_transforms(2, 1, 0.0, 3).squeeze(1).narrow(-1, 0, 3);
  EXPECT_TRUE(gradients_match([&](const auto& x) { return pose.dofs(x[0], x[1], x[2]); },
                              {{"theta", random_numbers({2, pose.size()}, 1)},
                               {"rotation", rotation},
                               {"position", random_numbers({2, 3}, 2)}}));
}

TEST(PoseDofs, RejectsWhatDoesNotFitTheSkeleton) {
  EXPECT_THAT(message_of<UsageError>([] {
                PoseDofs(test_actor().skeleton, {}, {1.0, 2.0});
              }),
              testing::HasSubstr("2 values given"));
  EXPECT_THAT(message_of<UsageError>([] {
                pose_of().root_relative(torch::zeros({1, 2}));
              }),
              testing::HasSubstr("theta"));
  Skeleton apart = test_actor().skeleton;
  apart.joints[5].offset.x() += 0.1;  // the last rotation of the root
  EXPECT_THAT(message_of<Error>([&] { PoseDofs(apart, {}, test_actor().rest_dofs); }), testing::HasSubstr("one point"));
}

TEST(RootRotation, StandsUprightAndFacesTheCameraAtTheStart) {
  const Tensor alpha =
      torch::tensor({{kUprightFacingCamera[0], kUprightFacingCamera[1], kUprightFacingCamera[2]}}, torch::kFloat64);
  // A level camera at +z that looks along -z: x right, y down.
  const Tensor camera = torch::tensor({{{1.0, 0.0, 0.0}, {0.0, -1.0, 0.0}, {0.0, 0.0, -1.0}}}, torch::kFloat64);
  EXPECT_TRUE(is_near(root_in_world(alpha, camera), torch::eye(3, torch::kFloat64).unsqueeze(0), 1e-15));
}

TEST(RootRotation, GradientEqualsCentralDifferencesAllTheWayRound) {
  const Tensor camera = test::random_transforms(6, 1, 0.0, 3).squeeze(1).narrow(-1, 0, 3);
  Tensor alpha = 0.2 * random_numbers({6, 3}, 2);
  alpha.select(1, 0) += torch::arange(6, torch::kFloat64);  // headings
  alpha.select(1, 1) += M_PI;
  EXPECT_TRUE(gradients_match([&](const auto& x) { return root_in_world(x[0], camera); }, {{"alpha", alpha}}));
  // No direction of alpha is without effect: the three columns of the derivative are independent.
  const Tensor first = test::leaf(alpha, torch::kFloat64);
  std::vector<Tensor> columns;
  const Tensor rotation = root_in_world(first, camera);
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c)
      columns.push_back(torch::autograd::grad({rotation.select(1, r).select(1, c).sum()}, {first}, {}, true)[0]);
  const Tensor jacobian = torch::stack(columns, 1);  // [6,9,3]
  const Tensor gram = torch::matmul(jacobian.transpose(1, 2), jacobian);
  EXPECT_GT(torch::linalg_det(gram).min().item<double>(), 1.0);
}

}  // namespace
}  // namespace doppel::pose_dofs_test
