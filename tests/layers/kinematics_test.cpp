#include "doppel/layers/kinematics/kinematics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "doppel/core/tensor/reference_scope.h"
#include "support/gradient_check.h"
#include "support/layer_inputs.h"
#include "support/message_of.h"
#include "support/test_character.h"

namespace doppel::kinematics_test {
namespace {

using support::message_of;
using namespace test;
using torch::Tensor;

/// Poses around the rest pose whose root stands `distance` metres away.
Tensor random_dofs(int64_t batch, double distance = 0.0, uint64_t seed = 3) {
  const int64_t D = test_actor().num_dofs();
  Tensor dofs = torch::tensor(test_actor().rest_dofs, torch::kFloat64) + 0.3 * random_numbers({batch, D}, seed);
  dofs.narrow(1, 0, 3) += distance;
  return dofs;
}

Tensor transform_tensor(const Eigen::Affine3d& transform) {
  Tensor result = torch::empty({3, 4}, torch::kFloat64);
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 4; ++c) result[r][c] = transform(r, c);
  }
  return result;
}

TEST(KinematicsReference, PosesJointsAsTheSkeletonDoes) {
  Kinematics kinematics(test_actor());
  const Tensor dofs = random_dofs(3);
  const Tensor joints = kinematics->joints(dofs), markers = kinematics->markers(dofs);
  for (int b = 0; b < 3; ++b) {
    const double* row = dofs[b].data_ptr<double>();
    const auto expected = test_actor().skeleton.pose(std::vector<double>(row, row + dofs.size(1)));
    for (size_t j = 0; j < expected.size(); ++j) {
      EXPECT_TRUE(is_near(joints[b][j], transform_tensor(expected[j]), 1e-12)) << "joint " << j;
    }
    for (size_t m = 0; m < test_actor().skeleton.markers.size(); ++m) {
      const Marker& marker = test_actor().skeleton.markers[m];
      const Eigen::Vector3d at = expected[marker.joint] * marker.position;
      EXPECT_TRUE(is_near(markers[b][m], torch::tensor({at.x(), at.y(), at.z()}, torch::kFloat64), 1e-12));
    }
  }
}

TEST(KinematicsReference, BonesAreIdentitiesInTheRestPose) {
  Kinematics kinematics(test_actor());
  const Tensor rest = torch::tensor(test_actor().rest_dofs, torch::kFloat64).unsqueeze(0);
  const Tensor bones = kinematics->bones(rest);
  const Tensor identity = torch::eye(4, torch::kFloat64).narrow(0, 0, 3);
  EXPECT_TRUE(is_near(bones, identity.expand_as(bones), 1e-12));
  EXPECT_TRUE(is_near(kinematics->bones(rest.to(torch::kFloat32)), identity.expand_as(bones), 1e-6));
}

TEST(KinematicsAgrees, KernelEqualsReference) {
  Kinematics kinematics(test_actor());
  for (int threads : {1, 2, 3}) {
    test::ThreadScope scope(threads);
    for (int64_t batch : {0, 1, 2, 5, 17}) {
      const Tensor dofs = random_dofs(batch).to(torch::kFloat32), exact = dofs.to(torch::kFloat64);
      EXPECT_TRUE(is_near(kinematics->joints(dofs), kinematics->joints(exact), 1e-7, 1e-7)) << batch;
      EXPECT_TRUE(is_near(kinematics->bones(dofs), kinematics->bones(exact), 1e-7, 1e-7)) << batch;
      EXPECT_TRUE(is_near(kinematics->markers(dofs), kinematics->markers(exact), 1e-7, 1e-7)) << batch;
    }
  }
}

TEST(KinematicsAgrees, FarFromTheOriginNothingButTheLastRoundingIsLost) {
  Kinematics kinematics(test_actor());
  const Tensor dofs = random_dofs(4, 7.0).to(torch::kFloat32);
  EXPECT_TRUE(is_near(kinematics->bones(dofs), kinematics->bones(dofs.to(torch::kFloat64)), 1e-7, 6e-8));
}

TEST(KinematicsAgrees, ReferenceScopeAndFloatReferenceComposeInDoubleToo) {
  Kinematics kinematics(test_actor());
  const Tensor dofs = random_dofs(4, 7.0).to(torch::kFloat32);
  const Tensor kernel = kinematics->joints(dofs);
  ReferenceScope scope;
  const Tensor reference = kinematics->joints(dofs);
  EXPECT_EQ(reference.scalar_type(), torch::kFloat32);
  EXPECT_TRUE(is_near(kernel, reference, 1e-7, 1.3e-7));
}

TEST(KinematicsAgrees, KernelGradientEqualsReference) {
  Kinematics kinematics(test_actor());
  for (int threads : {1, 2, 3}) {
    test::ThreadScope scope(threads);
    for (int64_t batch : {0, 1, 5}) {
      const Tensor dofs = leaf(random_dofs(batch), torch::kFloat32), exact = leaf(dofs, torch::kFloat64);
      const Tensor bones = kinematics->bones(dofs), exact_bones = kinematics->bones(exact);
      const Tensor probe = random_numbers(bones.sizes().vec(), 5);
      const Tensor found = test::gradients_of(bones, probe, {dofs})[0];
      const Tensor expected = test::gradients_of(exact_bones, probe, {exact})[0];
      EXPECT_TRUE(is_near(found, expected, 1e-4, 1e-5)) << "threads " << threads << ", batch " << batch;
    }
  }
}

TEST(KinematicsGradient, ReferenceEqualsCentralDifferences) {
  Kinematics kinematics(test_actor());
  const Tensor dofs = random_dofs(2);
  EXPECT_TRUE(gradients_match([&](const auto& x) { return kinematics->joints(x[0]); }, {{"dofs", dofs}}));
  EXPECT_TRUE(gradients_match([&](const auto& x) { return kinematics->bones(x[0]); }, {{"dofs", dofs}}));
  EXPECT_TRUE(gradients_match([&](const auto& x) { return kinematics->markers(x[0]); }, {{"dofs", dofs}}));
}

TEST(KinematicsGradient, ADofThatDrivesNothingHasNone) {
  Kinematics kinematics(test_actor());
  const Tensor dofs = leaf(random_dofs(2), torch::kFloat32);
  kinematics->joints(dofs).sum().backward();
  const int64_t idle = *test_actor().skeleton.find_dof("idle");
  EXPECT_EQ(dofs.grad().select(1, idle).abs().max().item<float>(), 0.0f);
  EXPECT_GT(dofs.grad().abs().max().item<float>(), 0.0f);
}

TEST(KinematicsRejects, AnotherNumberOfDofs) {
  Kinematics kinematics(test_actor());
  EXPECT_THAT(message_of([&] {
                kinematics->joints(torch::zeros({2, 3}));
              }),
              testing::AllOf(testing::HasSubstr("dofs"), testing::HasSubstr("[2,3]")));
  EXPECT_THAT(message_of([&] {
                kinematics->joints(torch::zeros({2, test_actor().num_dofs()}, torch::kInt64));
              }),
              testing::HasSubstr("floating-point"));
}

TEST(KinematicsRejects, ASecondDerivativeOfTheKernel) {
  Kinematics kinematics(test_actor());
  const Tensor dofs = leaf(random_dofs(1), torch::kFloat32);
  const Tensor loss = kinematics->joints(dofs).square().sum();
  const Tensor gradient = torch::autograd::grad({loss}, {dofs}, {}, true, /*create_graph=*/true)[0];
  EXPECT_THAT(message_of([&] { gradient.square().sum().backward(); }), testing::HasSubstr("no second derivative"));
}

}  // namespace
}  // namespace doppel::kinematics_test
