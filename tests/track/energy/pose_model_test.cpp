#include "doppel/track/energy/pose_model.h"

#include <gtest/gtest.h>

#include "doppel/character/blend_skin.h"
#include "doppel/layers/surface.h"
#include "track/energy/body_fixture.h"

namespace doppel::pose_model_test {
namespace {

constexpr int kSegments = 5;

const SkinningMode kModes[] = {SkinningMode::dual_quaternion, SkinningMode::linear};

class PoseModelSkinning : public testing::TestWithParam<SkinningMode> {};
INSTANTIATE_TEST_SUITE_P(Modes, PoseModelSkinning, testing::ValuesIn(kModes), [](const auto& mode) {
  return mode.param == SkinningMode::linear ? "linear" : "dual_quaternion";
});

TEST_P(PoseModelSkinning, EqualsTheBlendOfTheCharacter) {
  Character character = make_test_character(kSegments);
  character.skinning = GetParam();
  const PoseModel model(character, {}, all_dofs(character));
  const std::vector<double> dofs = bent_pose(character, 0.3);
  const std::vector<Eigen::Vector3d> blended = posed_vertices(character, dofs);
  const PosedBody body = model.pose(dofs, false);
  for (int v = 0; v < character.num_vertices(); ++v) EXPECT_LT((blended[v] - model.vertex(body, v)).norm(), 1e-12) << v;
}

TEST_P(PoseModelSkinning, EqualsTheSurfaceLayer) {
  Character character = make_test_character(kSegments);
  character.skinning = GetParam();
  const PoseModel model(character, tube_landmarks(kSegments), all_dofs(character));
  const std::vector<double> dofs = bent_pose(character, 0.3);
  torch::Tensor pose = torch::empty({1, character.num_dofs()});
  for (int d = 0; d < character.num_dofs(); ++d) pose[0][d] = dofs[d];
  torch::NoGradGuard no_grad;
  const torch::Tensor expected = CharacterSurface(character)->skinned(pose)[0].contiguous();
  const PosedBody body = model.pose(dofs, false);
  for (int v = 0; v < character.num_vertices(); ++v)
    for (int k = 0; k < 3; ++k) {
      ASSERT_NEAR(model.vertex(body, v)[k], expected[v][k].item<float>(), 2e-6) << "vertex " << v;
      ASSERT_NEAR((model.movement(body, v) * character.mesh.vertices[v])[k], model.vertex(body, v)[k], 1e-12);
    }
}

/// Jacobian of points along random directions against central differences, by every unknown.
template <typename Point, typename Jacobian>
void check_jacobian(const PoseModel& model, const std::vector<double>& dofs, int count, const Point& point,
                    const Jacobian& jacobian) {
  const PosedBody body = model.pose(dofs, true);
  constexpr double kStep = 1e-6;
  const Eigen::Vector3d along(0.3, -1.2, 0.7);
  for (int i = 0; i < count; ++i) {
    Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(model.num_unknowns());
    jacobian(body, i, along, PoseModel::Row(row.data(), row.size()));
    for (int u = 0; u < model.num_unknowns(); ++u) {
      const auto at = [&](double step) {
        const Eigen::VectorXd change = step * Eigen::VectorXd::Unit(model.num_unknowns(), u);
        return along.dot(point(model.pose(model.moved(dofs, change), false), i));
      };
      ASSERT_NEAR(row[u], (at(kStep) - at(-kStep)) / (2.0 * kStep), 1e-7) << i << " by " << model.unknown_name(u);
    }
  }
}

TEST(PoseModelGradient, Landmarks) {
  const Character character = make_test_character(kSegments);
  const PoseModel model(character, tube_landmarks(kSegments), all_dofs(character));
  check_jacobian(
      model, bent_pose(character, 0.4), model.num_landmarks(),
      [&](const PosedBody& body, int m) { return model.landmark(body, m); },
      [&](const PosedBody& body, int m, const Eigen::Vector3d& g, PoseModel::Row row) {
        model.add_landmark_jacobian(body, m, g, row);
      });
}

TEST_P(PoseModelSkinning, JacobianOfVertices) {
  Character character = make_test_character(kSegments, 6, 9);
  character.skinning = GetParam();
  const PoseModel model(character, tube_landmarks(kSegments), all_dofs(character));
  check_jacobian(
      model, bent_pose(character, 0.5), character.num_vertices(),
      [&](const PosedBody& body, int v) { return model.vertex(body, v); },
      [&](const PosedBody& body, int v, const Eigen::Vector3d& g, PoseModel::Row row) {
        model.add_vertex_jacobian(body, v, g, row);
      });
}

TEST(PoseModelGradient, WithPlainRootAnglesWhenOneOfThemIsGiven) {
  const Character character = make_test_character(kSegments);
  std::vector<int> dofs = all_dofs(character);
  dofs.erase(dofs.begin() + 4);
  const PoseModel model(character, tube_landmarks(kSegments), dofs);
  EXPECT_FALSE(model.root());
  EXPECT_EQ(model.num_unknowns(), character.num_dofs() - 1);
  check_jacobian(
      model, bent_pose(character, 0.4), model.num_landmarks(),
      [&](const PosedBody& body, int m) { return model.landmark(body, m); },
      [&](const PosedBody& body, int m, const Eigen::Vector3d& g, PoseModel::Row row) {
        model.add_landmark_jacobian(body, m, g, row);
      });
}

TEST(PoseModelGradient, WhereTheRootsAnglesAreSingular) {
  const Character character = make_test_character(kSegments);
  const PoseModel model(character, tube_landmarks(kSegments), all_dofs(character));
  ASSERT_TRUE(model.root());
  std::vector<double> dofs = bent_pose(character, 0.2);
  dofs[4] = 0.5 * M_PI / 3.0;  // the middle angle; its DoF has the weight 3
  check_jacobian(
      model, dofs, model.num_landmarks(), [&](const PosedBody& body, int m) { return model.landmark(body, m); },
      [&](const PosedBody& body, int m, const Eigen::Vector3d& g, PoseModel::Row row) {
        model.add_landmark_jacobian(body, m, g, row);
      });
}

TEST(RootRotation, ComesBackFromTheMatrixAndCountsWholeTurns) {
  const Character character = make_test_character(kSegments);
  const auto root = RootRotation::of(character.skeleton);
  ASSERT_TRUE(root);
  std::vector<double> dofs = character.rest_dofs;
  for (int frame = 0; frame < 40; ++frame) {
    const std::vector<double> before = dofs;
    root->set_matrix(dofs, rotation_of_vector(0.2 * Eigen::Vector3d::UnitY()) * root->matrix(before));
    EXPECT_NEAR(dofs[3] - before[3], 0.2 / 3.0, 1e-9) << "frame " << frame;
    EXPECT_NEAR(dofs[4], before[4], 1e-9);
    EXPECT_NEAR(dofs[5], before[5], 1e-9);
  }
  const Eigen::Vector3d position(1.0, 2.0, -3.0);
  root->set_position(dofs, position);
  EXPECT_LT((root->position(dofs) - position).norm(), 1e-12);
  EXPECT_LT((character.skeleton.pose(dofs)[root->joint()].translation() - position).norm(), 1e-12);
}

}  // namespace
}  // namespace doppel::pose_model_test
