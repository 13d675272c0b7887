#include <gmock/gmock.h>

#include <fstream>

#include "doppel/character/character.h"
#include "support/shared_folder.h"
#include "support/temporary_folder.h"

namespace doppel::real_character_test {
namespace {

/// A real, published character against the numbers of an independent implementation.
class RealOracle : public support::SharedFolderTest {
 protected:
  Character load(bool adaptive_radius = true) const {
    CharacterOptions options;
    options.graph.adaptive_radius = adaptive_radius;
    return load_character(character_file(), options);
  }

  /// The graph's weights against (vertex, node) pairs and values listed in any order.
  void expect_weights(const EmbeddedGraph& graph, const std::string& name) const {
    const std::vector<int> pairs = oracle(name + "_vertex_node").as<int>();
    const std::vector<double> values = oracle(name + "_value_f64").as<double>();
    ASSERT_EQ(pairs.size(), 2 * graph.weights.size());
    double largest = 0.0;
    for (std::size_t i = 0; i < values.size(); ++i) {
      const int vertex = pairs[2 * i], node = pairs[2 * i + 1];
      const auto nodes = graph.vertex_nodes.row(vertex);
      const auto found = std::find(nodes.begin(), nodes.end(), node);
      ASSERT_NE(found, nodes.end()) << "vertex " << vertex << ", node " << node;
      const double ours = graph.vertex_nodes.row_of(graph.weights, vertex)[found - nodes.begin()];
      largest = std::max(largest, std::abs(ours - values[i]));
    }
    EXPECT_LT(largest, 1e-6);
  }
};

TEST_F(RealOracle, JointTransformsOfAllPoses) {
  const Skeleton skeleton = load().skeleton;
  const NpyArray dofs_array = oracle("dofs_f64");
  const std::vector<double> dofs = dofs_array.as<double>();
  const NpyArray expected_array = oracle("joint_global_f64");
  const std::vector<double> expected = expected_array.as<double>();
  ASSERT_EQ(dofs_array.shape[1], skeleton.num_dofs());
  ASSERT_EQ(expected_array.shape, (std::vector<std::int64_t>{dofs_array.shape[0], skeleton.num_joints(), 4, 4}));
  double largest = 0.0;
  for (int p = 0; p < dofs_array.shape[0]; ++p) {
    const auto begin = dofs.begin() + p * skeleton.num_dofs();
    const auto transforms = skeleton.pose(std::vector<double>(begin, begin + skeleton.num_dofs()));
    for (int j = 0; j < skeleton.num_joints(); ++j)
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 4; ++c) {
          const double scale = c == 3 ? 1000.0 : 1.0;
          const double theirs = expected.at(((p * skeleton.num_joints() + j) * 4 + r) * 4 + c);
          largest = std::max(largest, std::abs(scale * transforms[j].matrix()(r, c) - theirs));
        }
  }
  RecordProperty("largest_difference_mm", std::to_string(largest));
  EXPECT_LT(largest, 1e-6);
}

TEST_F(RealOracle, JointsInFileOrderAndTheRestPose) {
  const Character character = load();
  std::ifstream names(shared_ / "oracle" / "joint_names.txt");
  std::string name;
  for (const Joint& joint : character.skeleton.joints) {
    ASSERT_TRUE(names >> name);
    EXPECT_EQ(joint.name, name);
  }
  const NpyArray dofs_array = oracle("dofs_f64");
  const std::vector<double> dofs = dofs_array.as<double>();
  for (int d = 0; d < character.num_dofs(); ++d) EXPECT_DOUBLE_EQ(character.rest_dofs[d], dofs.at(d));
}

TEST_F(RealOracle, BonesAndSkinWeights) {
  const Character character = load();
  EXPECT_EQ(character.bone_joint, oracle("bone_joint_index").as<int>());
  EXPECT_TRUE(character.skin.repaired);
  const std::vector<int> pairs = oracle("skin_vertex_bone").as<int>();
  const std::vector<double> weights = oracle("skin_weight_repaired_f64").as<double>();
  ASSERT_EQ(pairs.size(), 2 * character.skin.weights.size());
  std::size_t i = 0;
  double largest = 0.0;
  for (int v = 0; v < character.num_vertices(); ++v)
    for (const int bone : character.skin.vertex_bones.row(v)) {
      ASSERT_EQ(pairs[2 * i], v);
      ASSERT_EQ(pairs[2 * i + 1], bone);
      largest = std::max(largest, std::abs(character.skin.weights[i] - weights.at(i)));
      ++i;
    }
  EXPECT_LT(largest, 2e-6);  // the published weights sum to 1 within 1e-6; ours exactly
}

TEST_F(RealOracle, GraphWithTheSameRadiusEverywhere) {
  const EmbeddedGraph graph = load(false).graph;
  EXPECT_EQ(graph.node_vertex, oracle("node_vertex_index").as<int>());
  expect_weights(graph, "graph_weight");
}

TEST_F(RealOracle, GraphWithTheRadiusOfTheFarthestNeighbour) {
  const EmbeddedGraph graph = load().graph;
  EXPECT_EQ(graph.radius, oracle("graphdef_radius").as<double>());
  expect_weights(graph, "graphdef_weight");
}

TEST_F(RealOracle, Rigidity) {
  const Character character = load();
  const std::vector<double> expected = oracle("vertex_rigidity_f64").as<double>();
  EXPECT_EQ(vertex_rigidity(character.labels, character.num_vertices(), RigidityPreset::laplacian), expected);
}

TEST_F(RealOracle, MarkersAreWorldPositionsOfTheZeroPose) {
  const Character character = load();
  EXPECT_EQ(character.skeleton.marker_reading, MarkerReading::zero_pose_world);
  Skeleton skeleton = character.skeleton;
  const MarkerDistances distance = decide_marker_reading(skeleton, character.rest_dofs, character.mesh);
  EXPECT_NEAR(distance.joint_relative, 0.468, 0.01);
  EXPECT_NEAR(distance.zero_pose_world, 0.032, 0.005);
}

TEST_F(RealOracle, TheSkeletonLiesInTheTemplate) {
  Character character = load();
  EXPECT_LT(skeleton_distance(character), 0.05);
  character.rest_dofs.assign(character.rest_dofs.size(), 0.0);  // as if the rest pose had been forgotten
  EXPECT_GT(skeleton_distance(character), kSkeletonOffTemplate);
}

TEST_F(RealOracle, WrittenAndReadItIsTheSameCharacter) {
  const support::TemporaryFolder folder;
  const Character written = load();
  const Character read_back = load_character(write_character(folder.path(), written));
  EXPECT_EQ(read_back.fingerprint(), written.fingerprint());
  EXPECT_EQ(read_back.mesh.vertices, written.mesh.vertices);
  EXPECT_EQ(read_back.mesh.face_uvs, written.mesh.face_uvs);
  EXPECT_EQ(read_back.skin.weights, written.skin.weights);
  EXPECT_EQ(read_back.rest_dofs, written.rest_dofs);
  EXPECT_EQ(read_back.graph.weights, written.graph.weights);
  EXPECT_EQ(read_back.labels, written.labels);
  for (int j = 0; j < written.skeleton.num_joints(); ++j) {
    EXPECT_EQ(read_back.skeleton.joints[j].offset, written.skeleton.joints[j].offset);
    EXPECT_EQ(read_back.skeleton.joints[j].axis, written.skeleton.joints[j].axis);
  }
}

TEST_F(RealOracle, RootOrder) {
  const Skeleton::Root root = load().skeleton.root();
  EXPECT_EQ(root.axes, (std::array<int, 3>{1, 2, 0}));
  EXPECT_EQ(root.translation, (std::array<int, 3>{0, 1, 2}));
  for (int i = 0; i < 3; ++i) {
    EXPECT_DOUBLE_EQ(root.translation_weight[i], 1.0);
    EXPECT_DOUBLE_EQ(root.rotation_weight[i], 3.0);
  }
}

}  // namespace
}  // namespace doppel::real_character_test
