#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/npy.h"
#include "doppel/io/scene/read_scene.h"
#include "support/shared_folder.h"

namespace doppel::support {

/// A rigged body with a reference: 200 vertices at one time of one animation, in the units of the file. The parameter
/// names the body.
class RigReferenceTest : public SharedFolderTest, public ::testing::WithParamInterface<const char*> {
 protected:
  void SetUp() override {
    SharedFolderTest::SetUp();
    if (IsSkipped()) return;
    folder_ = shared_ / "bodies" / GetParam();
    if (!std::filesystem::exists(folder_)) GTEST_SKIP() << folder_ << " does not exist";
    reference_ = nlohmann::json::parse(read_file(folder_ / "anim_reference.json"));
    ground_truth_ = read_npy(folder_ / "anim_posed.npy").as<double>();
    scene_ = read_scene(folder_ / reference_["file"].get<std::string>());
  }

  const SceneAnimation& animation() const {
    if (reference_.contains("animation_index"))
      return scene_.animations.at(reference_["animation_index"].get<std::size_t>());
    for (const SceneAnimation& animation : scene_.animations)
      if (reference_["animation_stack"] == animation.name) return animation;
    fail("no such animation");
  }

  /// The vertex of the scene, in the order of primitives, that a row of the reference names.
  int vertex_of(std::size_t row) const {
    if (reference_.contains("geometry_vertex")) return reference_["geometry_vertex"][row].get<int>();
    const nlohmann::json& name = reference_["node_primitive_vertex"][row];
    int first = 0;
    for (const ScenePrimitive& primitive : scene_.primitives) {
      if (primitive.node == name[0] && primitive.index == name[1]) return first + name[2].get<int>();
      first += primitive.num_vertices();
    }
    fail("no such primitive");
  }

  /// Largest distance to the reference, metres. Counts the vertices of the reference among the posed ones in `found_`.
  /// @param posed metres @param map vertex of the file of each of the posed vertices
  double largest_error(const std::vector<Eigen::Vector3d>& posed, const std::vector<int>& map,
                       const Eigen::Affine3d& file_from_character) {
    std::map<int, std::size_t> ours;
    for (std::size_t i = 0; i < map.size(); ++i) ours.emplace(map[i], i);
    double largest = 0.0;
    found_ = 0;
    for (std::size_t row = 0; 3 * row < ground_truth_.size(); ++row) {
      const auto vertex = ours.find(vertex_of(row));
      if (vertex == ours.end()) continue;
      ++found_;
      const Eigen::Vector3d ground_truth =
          file_from_character.inverse() * Eigen::Map<const Eigen::Vector3d>(&ground_truth_[3 * row]);
      largest = std::max(largest, (posed[vertex->second] - ground_truth).norm());
    }
    return largest;
  }

  std::filesystem::path folder_;
  nlohmann::json reference_;
  std::vector<double> ground_truth_;  ///< [200 * 3]
  Scene scene_;
  int found_ = 0;
};

/// The bodies that have a reference.
inline auto rig_references() {
  return ::testing::Values("cesium_man", "m2m_male_apose", "mh_girl_dress", "mh_man_old_suit", "mh_woman_slim",
                           "quaternius_dress_fbx", "robot_expressive");
}

}  // namespace doppel::support
