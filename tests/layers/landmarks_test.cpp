#include "doppel/layers/landmarks/landmarks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/script.h>

#include "doppel/core/error.h"
#include "doppel/layers/pose_dofs.h"
#include "doppel/layers/surface.h"
#include "doppel/layers/transform_math.h"
#include "support/gradient_check.h"
#include "support/layer_inputs.h"
#include "support/message_of.h"
#include "support/test_character.h"

namespace doppel::landmarks_test {
namespace {

using namespace test;
using torch::Tensor;

/// Some beside the skeleton's own markers.
std::vector<Marker> landmarks() {
  std::vector<Marker> found = test_actor().skeleton.markers;
  found.push_back({"hip", 5, {0.1, 0.0, -0.1}, 0.0});
  found.push_back({"tip", test_actor().skeleton.num_joints() - 1, {0.0, 0.3, 0.0}, 0.0});
  return found;
}

Tensor random_dofs(int64_t batch, uint64_t seed = 3) {
  return torch::tensor(test_actor().rest_dofs, torch::kFloat64) +
         0.3 * random_numbers({batch, test_actor().num_dofs()}, seed);
}
Tensor random_rotations(int64_t batch, uint64_t seed) {
  return test::random_transforms(batch, 1, 0.0, seed).squeeze(1).narrow(-1, 0, 3);
}

TEST(Landmarks, RideOnTheirJoints) {
  const Landmarks layer(test_actor().skeleton, landmarks());
  const Tensor dofs = random_dofs(1), found = layer->forward(dofs);
  const double* row = dofs.data_ptr<double>();
  const auto joints = test_actor().skeleton.pose(std::vector<double>(row, row + dofs.numel()));
  for (int64_t m = 0; m < layer->size(); ++m) {
    const Marker marker = landmarks()[m];
    const Eigen::Vector3d at = joints[marker.joint] * marker.position;
    EXPECT_TRUE(is_near(found[0][m], torch::tensor({at.x(), at.y(), at.z()}, torch::kFloat64), 1e-12));
  }
}

TEST(Landmarks, AreTheSameByTheCameraAndByTheDofs) {
  const Landmarks layer(test_actor().skeleton, landmarks());
  const PoseDofs pose(test_actor().skeleton, {}, test_actor().rest_dofs);
  const Tensor theta = 0.3 * random_numbers({3, pose.size()}, 1), alpha = random_numbers({3, 3}, 2);
  const Tensor position = 2.0 * random_numbers({3, 3}, 4);
  const Tensor rotation = root_in_world(alpha, random_rotations(3, 5));
  // 5.1: turn the root-relative landmarks, then add t; against forward kinematics of all DoFs.
  const Tensor aligned = turn_points(rotation, layer->forward(pose.root_relative(theta))) + position.unsqueeze(1);
  EXPECT_TRUE(is_near(aligned, layer->forward(pose.dofs(theta, rotation, position)), 1e-12));
}

TEST(Landmarks, GradientToThetaAndAlphaEqualsCentralDifferences) {
  const Landmarks layer(test_actor().skeleton, landmarks());
  const PoseDofs pose(test_actor().skeleton, {"lean_*", "bend"}, test_actor().rest_dofs);
  const Tensor camera = random_rotations(2, 5);
  EXPECT_TRUE(gradients_match(
      [&](const auto& x) { return turn_points(root_in_world(x[1], camera), layer->forward(pose.root_relative(x[0]))); },
      {{"theta", 0.3 * random_numbers({2, pose.size()}, 1)}, {"alpha", random_numbers({2, 3}, 2)}}));
}

TEST(Landmarks, RejectAJointThatIsNotThere) {
  EXPECT_THAT(support::message_of<UsageError>([] {
                Landmarks(test_actor().skeleton, std::vector<Marker>{{"nose", 99, {0.0, 0.0, 0.0}, 0.0}});
              }),
              testing::HasSubstr("'nose' rides on joint 99"));
}

TEST(GraphLandmarks, AreTheRestPositionsInTheRestPose) {
  CharacterSurface surface(test_actor());
  const GraphLandmarks layer(test_actor(), landmarks());
  const Landmarks posed(test_actor().skeleton, landmarks());
  const Tensor rest = torch::tensor(test_actor().rest_dofs, torch::kFloat64).unsqueeze(0);
  const Tensor zero = torch::zeros({1, test_actor().num_nodes(), 3}, torch::kFloat64);
  EXPECT_TRUE(is_near(layer->forward(zero, zero, surface->node_transforms(rest)), posed->forward(rest), 1e-12));
}

TEST(GraphLandmarks, MoveAsTheirNodeDoes) {
  CharacterSurface surface(test_actor());
  const GraphLandmarks layer(test_actor(), landmarks());
  const Tensor A = 0.3 * random_numbers({2, test_actor().num_nodes(), 3}, 1),
               T = 0.1 * random_numbers({2, test_actor().num_nodes(), 3}, 2);
  const Tensor transforms = surface->node_transforms(random_dofs(2));
  const Tensor found = layer->forward(A, T, transforms);
  const auto joints = test_actor().skeleton.pose(test_actor().rest_dofs);
  for (size_t m = 0; m < landmarks().size(); ++m) {
    const int k = layer->nodes()[m];
    const auto tensor = [](const Eigen::Vector3d& x) { return torch::tensor({x.x(), x.y(), x.z()}, torch::kFloat64); };
    const Tensor p = tensor(joints[landmarks()[m].joint] * landmarks()[m].position);
    const Tensor g = tensor(test_actor().mesh.vertices[test_actor().graph.node_vertex[k]]);
    const Tensor deformed = torch::matmul(euler_to_matrix(A.select(1, k)), p - g) + g + T.select(1, k);
    EXPECT_TRUE(
        is_near(found.select(1, static_cast<int64_t>(m)), transform_points(transforms.select(1, k), deformed), 1e-12));
  }
}

TEST(GraphLandmarks, GradientEqualsCentralDifferences) {
  CharacterSurface surface(test_actor());
  std::vector<Marker> doubled = landmarks();
  doubled.push_back(doubled.front());  // two on one node: their gradients add up
  const GraphLandmarks layer(test_actor(), doubled);
  EXPECT_TRUE(gradients_match([&](const auto& x) { return layer->forward(x[0], x[1], x[2]); },
                              {{"A", 0.3 * random_numbers({2, test_actor().num_nodes(), 3}, 1)},
                               {"T", 0.1 * random_numbers({2, test_actor().num_nodes(), 3}, 2)},
                               {"node_transforms", surface->node_transforms(random_dofs(2))}}));
}

TEST(GraphLandmarks, KernelEqualsReference) {
  CharacterSurface surface(test_actor());
  const GraphLandmarks layer(test_actor(), landmarks());
  const Tensor A = 0.3 * random_numbers({3, test_actor().num_nodes(), 3}, 1),
               T = 0.1 * random_numbers({3, test_actor().num_nodes(), 3}, 2);
  const Tensor transforms = surface->node_transforms(random_dofs(3));
  const auto single = [](const Tensor& x) { return x.to(torch::kFloat32); };
  EXPECT_TRUE(
      is_near(layer->forward(single(A), single(T), single(transforms)), layer->forward(A, T, transforms), 1e-5));
}

}  // namespace
}  // namespace doppel::landmarks_test
