#include <gtest/gtest.h>
#include <torch/types.h>

#include "doppel/layers/surface.h"
#include "support/gradient_check.h"
#include "support/layer_inputs.h"
#include "support/shared_folder.h"

// The numbers of an independent implementation on a real character (millimetres in its files, metres here).

namespace doppel::real_character_test {
namespace {

using test::is_near;
using torch::Tensor;

constexpr double kMillimetre = 1e-3;

class RealCharacter : public support::SharedFolderTest {
 protected:
  void SetUp() override {
    SharedFolderTest::SetUp();
    if (!IsSkipped()) dofs_ = oracle("dofs_f64", 1.0);
  }

  /// An array of the oracle times `scale`.
  Tensor oracle(const std::string& name, double scale) const {
    const NpyArray array = SharedFolderTest::oracle(name);
    return torch::tensor(array.as<double>(), torch::kFloat64).view(array.shape) * scale;
  }
  /// [...,4,4] transforms in millimetres as [...,3,4] in metres.
  Tensor oracle_transforms(const std::string& name) const {
    Tensor transforms = oracle(name, 1.0).narrow(-2, 0, 3).clone();
    transforms.select(-1, 3) *= kMillimetre;
    return transforms;
  }

  const Character& actor() const {
    static const Character character = [this] {
      CharacterOptions options;
      options.graph.adaptive_radius = false;  // the oracle's deformations have radius 3 for all nodes
      return load_character(character_file(), options);
    }();
    return character;
  }

  /// The oracle's poses, bent a little further and moved by metres.
  Tensor further_dofs(double distance) const {
    Tensor dofs = dofs_ + 0.1 * test::random_numbers(dofs_.sizes().vec(), 2);
    dofs.narrow(1, 0, 3) += distance * test::random_numbers({dofs.size(0), 3}, 3).clamp(-1.0, 1.0);
    return dofs;
  }

  Tensor dofs_;
};

using RealKinematics = RealCharacter;
using RealSkinning = RealCharacter;
using RealEmbeddedDeformation = RealCharacter;

Tensor single(const Tensor& value) { return value.to(torch::kFloat32); }

TEST_F(RealKinematics, JointsEqualTheOracle) {
  Kinematics kinematics(actor());
  const Tensor expected = oracle_transforms("joint_global_f64");
  EXPECT_TRUE(is_near(kinematics->joints(dofs_), expected, 1e-6 * kMillimetre));
  EXPECT_TRUE(is_near(kinematics->joints(single(dofs_)).select(-1, 3), expected.select(-1, 3), 1e-3 * kMillimetre));
}

TEST_F(RealKinematics, BonesEqualTheOracle) {
  Kinematics kinematics(actor());
  const Tensor world = oracle_transforms("bone_global_f64");
  const Tensor rest = world[0].narrow(-1, 0, 3).transpose(-1, -2);  // its inverse rotations
  // A(theta) A(rest)^-1 = [R R0^T | t - R R0^T t0].
  const Tensor rotation = torch::matmul(world.narrow(-1, 0, 3), rest);
  const Tensor translation =
      world.select(-1, 3) - torch::matmul(rotation, world[0].select(-1, 3).unsqueeze(-1)).squeeze(-1);
  const Tensor expected = torch::cat({rotation, translation.unsqueeze(-1)}, -1);
  EXPECT_TRUE(is_near(kinematics->bones(dofs_), expected, 1e-6 * kMillimetre));
  EXPECT_TRUE(is_near(kinematics->bones(single(dofs_)), expected, 1e-3 * kMillimetre));
}

TEST_F(RealKinematics, SinglePrecisionHoldsOnPosesFurtherAway) {
  Kinematics kinematics(actor());
  for (double distance : {0.0, 3.0}) {
    const Tensor dofs = further_dofs(distance);
    EXPECT_TRUE(is_near(kinematics->joints(single(dofs)).select(-1, 3), kinematics->joints(dofs).select(-1, 3),
                        1e-3 * kMillimetre));
  }
}

TEST_F(RealSkinning, VerticesEqualTheOracle) {
  CharacterSurface dual(actor(), SkinningMode::dual_quaternion), linear(actor(), SkinningMode::linear);
  const Tensor expected_dual = oracle("verts_dqs_vertex_repairedskin_f64", kMillimetre);
  const Tensor expected_linear = oracle("verts_lbs_vertex_repairedskin_f64", kMillimetre);
  EXPECT_TRUE(is_near(dual->skinned(dofs_), expected_dual, 5e-5 * kMillimetre));
  EXPECT_TRUE(is_near(dual->skinned(single(dofs_)), expected_dual, 1e-2 * kMillimetre));
  EXPECT_TRUE(is_near(linear->skinned(dofs_), expected_linear, 1e-6 * kMillimetre));
  EXPECT_TRUE(is_near(linear->skinned(single(dofs_)), expected_linear, 1e-3 * kMillimetre));
  Character linear_actor = actor();
  linear_actor.skinning = SkinningMode::linear;
  EXPECT_TRUE(is_near(CharacterSurface(linear_actor)->skinned(dofs_), expected_linear, 1e-6 * kMillimetre));
}

TEST_F(RealSkinning, NodesEqualTheOracle) {
  CharacterSurface surface(actor());
  const Tensor transforms = oracle_transforms("node_transform_dqs_f64");
  const Tensor vertices = oracle("verts_dqs_node_repairedskin_f64", kMillimetre);
  // The file of the transforms comes from the weights as they stand in the glued .skin: its own vertices are up to 0.04
  // mm off those of the file below. It can only show that the transforms are the right ones.
  EXPECT_TRUE(is_near(surface->node_transforms(dofs_).narrow(-1, 0, 3), transforms.narrow(-1, 0, 3), 1e-3));
  const Tensor rest = torch::cat(
      {surface->embedded_deformation()->graph().nodes, torch::ones({actor().num_nodes(), 1}, torch::kFloat64)}, 1);
  const auto at_nodes = [&](const Tensor& m) { return torch::matmul(m, rest.unsqueeze(-1)).squeeze(-1); };
  EXPECT_TRUE(is_near(at_nodes(surface->node_transforms(dofs_)), at_nodes(transforms), 0.1 * kMillimetre));
  EXPECT_TRUE(is_near(surface->skinned_by_nodes(dofs_), vertices, 5e-5 * kMillimetre));
  EXPECT_TRUE(is_near(surface->skinned_by_nodes(single(dofs_)), vertices, 1e-2 * kMillimetre));
}

TEST_F(RealSkinning, SinglePrecisionHoldsOnPosesFurtherAway) {
  CharacterSurface dual(actor(), SkinningMode::dual_quaternion), linear(actor(), SkinningMode::linear);
  for (double distance : {0.0, 3.0}) {
    const Tensor dofs = further_dofs(distance);
    EXPECT_TRUE(is_near(dual->skinned(single(dofs)), dual->skinned(dofs), 2e-3 * kMillimetre)) << distance;
    EXPECT_TRUE(is_near(linear->skinned(single(dofs)), linear->skinned(dofs), 1e-3 * kMillimetre)) << distance;
    EXPECT_TRUE(is_near(dual->skinned_by_nodes(single(dofs)), dual->skinned_by_nodes(dofs), 2e-3 * kMillimetre))
        << distance;
  }
}

TEST_F(RealEmbeddedDeformation, EulerMatricesEqualTheOracle) {
  EXPECT_TRUE(is_near(euler_to_matrix(oracle("euler_angles_f64", 1.0)), oracle("euler_matrices_f64", 1.0), 1e-12));
}

TEST_F(RealEmbeddedDeformation, CanonicalAndPosedVerticesEqualTheOracle) {
  CharacterSurface surface(actor());
  const EmbeddedDeformation layer = surface->embedded_deformation();
  const Tensor A = oracle("rand_deltaR_euler_f32", 1.0), T = oracle("rand_deltaT_mm_f32", kMillimetre);
  const Tensor D = oracle("rand_disp_mm_f32", kMillimetre);
  const Tensor canonical = oracle("eg_canonical_f64", kMillimetre),
               displaced = oracle("delta_canonical_f64", kMillimetre);
  const Tensor posed = oracle("posed_delta_dqs_node_repairedskin_f64", kMillimetre);
  EXPECT_TRUE(is_near(layer.ptr()->forward(A, T), canonical, 1e-6 * kMillimetre));
  EXPECT_TRUE(is_near(layer.ptr()->forward(A, T, D), displaced, 1e-6 * kMillimetre));
  EXPECT_TRUE(is_near(surface->deformed(dofs_, A, T, D), posed, 5e-5 * kMillimetre));
  EXPECT_TRUE(is_near(layer.ptr()->forward(single(A), single(T)), canonical, 1e-2 * kMillimetre));
  EXPECT_TRUE(is_near(layer.ptr()->forward(single(A), single(T), single(D)), displaced, 1e-2 * kMillimetre));
  EXPECT_TRUE(is_near(surface->deformed(single(dofs_), single(A), single(T), single(D)), posed, 1e-2 * kMillimetre));
}

TEST_F(RealEmbeddedDeformation, SinglePrecisionHoldsOnPosesFurtherAway) {
  CharacterSurface surface(actor());
  const int64_t K = actor().num_nodes(), N = actor().num_vertices();
  const Tensor A = test::random_numbers({4, K, 3}, 5), T = 0.2 * test::random_numbers({4, K, 3}, 6);
  const Tensor D = 0.05 * test::random_numbers({4, N, 3}, 7);
  for (double distance : {0.0, 3.0}) {
    const Tensor dofs = further_dofs(distance);
    EXPECT_TRUE(is_near(surface->deformed(single(dofs), single(A), single(T), single(D)),
                        surface->deformed(dofs, A, T, D), 5e-3 * kMillimetre));
  }
}

}  // namespace
}  // namespace doppel::real_character_test
