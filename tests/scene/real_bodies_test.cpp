#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>

#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/npy.h"
#include "doppel/scene/read_scene.h"
#include "support/shared_folder.h"

namespace doppel::real_bodies_test {
namespace {

using Json = nlohmann::json;

/// The rigged bodies with a reference of one animation, in the units of their files.
class RealRiggedBodies : public support::SharedFolderTest, public ::testing::WithParamInterface<const char*> {
 protected:
  void SetUp() override {
    SharedFolderTest::SetUp();
    if (IsSkipped()) return;
    folder_ = shared_ / "bodies" / GetParam();
    if (!std::filesystem::exists(folder_)) GTEST_SKIP() << folder_ << " does not exist";
    reference_ = Json::parse(read_file(folder_ / "anim_reference.json"));
    scene_ = read_scene(folder_ / reference_["file"].get<std::string>());
  }

  const SceneAnimation& animation() const {
    if (reference_.contains("animation_index"))
      return scene_.animations.at(reference_["animation_index"].get<std::size_t>());
    for (const SceneAnimation& animation : scene_.animations)
      if (animation.name == reference_["animation_stack"]) return animation;
    fail("no such animation");
  }

  /// The vertex of the scene that a row of the reference names.
  int vertex_of(std::size_t row) const {
    if (reference_.contains("geometry_vertex")) return reference_["geometry_vertex"][row].get<int>();
    const Json& name = reference_["node_primitive_vertex"][row];
    int first = 0;
    for (const ScenePrimitive& primitive : scene_.primitives) {
      if (primitive.node == name[0] && primitive.index == name[1]) return first + name[2].get<int>();
      first += primitive.num_vertices();
    }
    fail("no such primitive");
  }

  double largest_error(const std::vector<Eigen::Vector3d>& posed, const std::vector<double>& truth) const {
    double largest = 0.0;
    for (std::size_t row = 0; 3 * row < truth.size(); ++row)
      largest = std::max(
          largest, (posed.at(as_size(vertex_of(row))) - Eigen::Map<const Eigen::Vector3d>(&truth[3 * row])).norm());
    return largest;
  }

  std::filesystem::path folder_;
  Json reference_;
  Scene scene_;
};

TEST_P(RealRiggedBodies, VerticesAreWhereTheFileTakesThem) {
  const double metre = 1 / scene_.metres_per_unit.value();
  const auto world = node_transforms(scene_, animation(), reference_["time_s"].get<double>());
  const auto truth = read_npy(folder_ / "anim_posed.npy").as<double>();
  EXPECT_LT(largest_error(posed_vertices(scene_, world), truth), 5e-6 * metre);
}

TEST_P(RealRiggedBodies, JointsAreWhereTheFileTakesThem) {
  const double metre = 1 / scene_.metres_per_unit.value();
  const auto world = node_transforms(scene_, animation(), reference_["time_s"].get<double>());
  std::map<std::string, std::size_t> node;
  for (std::size_t i = 0; i < scene_.nodes.size(); ++i) node[scene_.nodes[i].name] = i;
  for (const auto& [name, position] : reference_["joint_world"].items()) {
    ASSERT_TRUE(node.count(name)) << name;
    const Eigen::Vector3d truth(position[0], position[1], position[2]);
    EXPECT_LT((world[node[name]].translation() - truth).norm(), 5e-6 * metre) << name;
  }
}

INSTANTIATE_TEST_SUITE_P(Real, RealRiggedBodies,
                         ::testing::Values("cesium_man", "m2m_male_apose", "mh_girl_dress", "mh_man_old_suit",
                                           "mh_woman_slim", "quaternius_dress_fbx", "robot_expressive"),
                         [](const auto& body) { return std::string(body.param); });

}  // namespace
}  // namespace doppel::real_bodies_test
