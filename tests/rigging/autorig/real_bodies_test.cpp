#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "doppel/core/error.h"
#include "doppel/io/scene/read_scene.h"
#include "doppel/rigging/autorig/create_character.h"
#include "doppel/rigging/autorig/find_joints.h"
#include "doppel/rigging/autorig/scan_of_scene.h"
#include "doppel/rigging/joints/move_inside.h"
#include "support/blazepose_weights.h"

namespace doppel::real_bodies_test {
namespace {

namespace fs = std::filesystem;

class RealBodies : public support::BlazePoseTest {
 protected:
  fs::path folder(const std::string& body) const { return shared_ / "bodies" / body; }

  nlohmann::json ground_truth_of(const fs::path& file) const {
    return nlohmann::json::parse(std::ifstream(file))["landmarks"];
  }

  /// Distances of joints from the true limb joints, ascending, in the unit of both.
  std::vector<double> errors(const BodyJoints& joints, const nlohmann::json& ground_truth) const {
    std::vector<double> distances;
    for (const std::string& name : limb_joint_names()) {
      const auto& expected = ground_truth[name.substr(0, 1) + name.substr(name.find('_'))];
      distances.push_back((joints.at(name) - Eigen::Vector3d(expected[0], expected[1], expected[2])).norm());
    }
    std::sort(distances.begin(), distances.end());
    return distances;
  }

  /// The goal for bodies of realistic shape: the median within 25 mm, the worst joint within 60 mm.
  /// @param distances of the twelve limb joints, millimetres, ascending
  void expect_small(const std::string& name, const std::vector<double>& distances) {
    ASSERT_EQ(distances.size(), 12u) << name;
    const double median = 0.5 * (distances[5] + distances[6]);
    RecordProperty(name + "_median_mm", std::to_string(median));
    RecordProperty(name + "_worst_mm", std::to_string(distances.back()));
    EXPECT_LE(median, 25.0) << name;
    EXPECT_LE(distances.back(), 60.0) << name;
  }
};

TEST_F(RealBodies, JointsAreFoundInImages) {
  for (const char* body :
       {"m2m_female", "m2m_male_apose", "mh_girl_dress", "mh_man_old_suit", "mh_man_workwear", "mh_woman_slim"}) {
    const TriangleMesh mesh = read_obj(folder(body) / "body.obj", 1.0);
    FoundJoints found = find_joints(mesh);
    move_inside(found.joints, solid_grid(VoxelSolid(mesh)));
    std::vector<double> distances = errors(found.joints, ground_truth_of(folder(body) / "truth.json"));
    for (double& distance : distances) distance *= 1e3;
    expect_small(body, distances);
  }
}

TEST_F(RealBodies, ScansBecomeCharacters) {
  for (const char* body : {"mh_girl_dress", "mh_man_old_suit"}) {
    const CreatedCharacter created =
        create_character("actor", scan_of_scene(read_scene(folder(body) / "scan.obj")), CreateCharacterOptions());
    EXPECT_LE(created.character.num_vertices(), CreateCharacterOptions().vertices);
    EXPECT_EQ(created.character.num_nodes(), CreateCharacterOptions().nodes);
    EXPECT_FALSE(created.joint_sheet.empty());
    EXPECT_FALSE(created.pose_sheet.empty());
    EXPECT_EQ(created.bending.poses.size(), 5u);
    EXPECT_EQ(created.bending.vertices, created.character.num_vertices());
    BodyJoints in_file = created.joints.joints;
    for (auto& [name, position] : in_file.positions) position = created.joints.file_from_character * position;
    const double units_per_metre = std::cbrt(created.joints.file_from_character.linear().determinant());
    std::vector<double> distances = errors(in_file, ground_truth_of(folder(body) / "scan_truth.json"));
    for (double& distance : distances) distance *= 1e3 / units_per_metre;
    expect_small(std::string(body) + "_scan", distances);
  }
}

TEST_F(RealBodies, WithFreeLimbsBendWithinTheLimits) {
  for (const char* body : {"m2m_female", "m2m_male_apose", "mh_man_workwear", "mh_woman_slim", "cesium_man"}) {
    const CreatedCharacter created =
        create_character("actor", scan_of_scene(read_scene(folder(body) / "body.obj")), CreateCharacterOptions());
    ASSERT_EQ(created.bending.poses.size(), 5u);
    for (const PoseBend& bend : created.bending.poses) {
      EXPECT_TRUE(bend.elbow_volume && bend.knee_volume) << body << " " << bend.pose;
    }
    for (const std::string& fault : created.bending.faults()) ADD_FAILURE() << body << ": " << fault;
  }
}

TEST_F(RealBodies, ABustIsRefused) {
  TriangleMesh mesh = read_obj(folder("mh_woman_slim") / "body.obj", 1.0);
  std::erase_if(mesh.faces, [&](const Triangle& face) { return mesh.vertices[face[0]].y() < 1.0; });
  for (Eigen::Vector3d& vertex : mesh.vertices) vertex.y() = std::max(vertex.y(), 1.0);
  EXPECT_THROW(find_joints(mesh), Error);
}

}  // namespace
}  // namespace doppel::real_bodies_test
