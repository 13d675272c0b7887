#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/npy.h"
#include "doppel/io/rig_import/import_rig.h"
#include "doppel/io/rig_import/landmarks_of_rig.h"
#include "support/rig_reference.h"
#include "support/temporary_folder.h"

namespace doppel::real_rigs_test {
namespace {

using Json = nlohmann::json;
using Points = std::vector<Eigen::Vector3d>;

/// Linear blend skinning of a character, in double.
Points skinned(const Character& character, const std::vector<double>& dofs) {
  const auto pose = character.skeleton.pose(dofs), rest = character.skeleton.pose(character.rest_dofs);
  std::vector<Eigen::Affine3d> bones;
  for (const int joint : character.bone_joint) bones.push_back(pose[joint] * rest[joint].inverse());
  Points posed;
  for (int v = 0; v < character.num_vertices(); ++v) {
    Eigen::Vector3d x = Eigen::Vector3d::Zero();
    const auto row = character.skin.vertex_bones.row(v);
    const auto weights = character.skin.vertex_bones.row_of(character.skin.weights, v);
    for (std::size_t i = 0; i < row.size(); ++i) x += weights[i] * (bones[row[i]] * character.mesh.vertices[v]);
    posed.push_back(x);
  }
  return posed;
}

class RealRigs : public support::RigReferenceTest {
 protected:
  support::TemporaryFolder out_;
};

TEST_P(RealRigs, WrittenAndReadBackTheCharacterMovesAsTheFile) {
  const double seconds = reference_["time_s"].get<double>();
  ImportRigOptions options;
  options.animations = {animation().name};
  // A rate that has a frame at the time of the reference.
  options.frames_per_second = std::abs(seconds * 1000 - std::round(seconds * 1000)) < 1e-6 ? 1000 : 10000;
  const ImportedRig rig = import_rig(scene_, options);
  ASSERT_EQ(rig.motions.size(), 1U);
  EXPECT_LT(rig.motions[0].error, 3e-5);
  const std::filesystem::path file = write_imported_rig(out_.path(), rig);
  const Character character = load_character(file);
  EXPECT_EQ(character.fingerprint(), rig.character.fingerprint());
  const Motion motion = read_motion(out_ / rig.motions[0].file, character.num_dofs());
  const auto frame = as_size(std::llround((seconds - rig.motions[0].start) * rig.motions[0].frames_per_second));
  const std::vector<int> map = read_npy(out_ / "vertex_map.npy").as<int>();
  EXPECT_LT(largest_error(skinned(character, motion.frames.at(frame)), map, rig.file_from_character), 2e-5);
  EXPECT_EQ(found_, 200);
}

TEST_P(RealRigs, StraightLinesBetweenFramesOfTheUsualRateAreExactEnough) {
  const double seconds = reference_["time_s"].get<double>();
  ImportRigOptions options;
  options.animations = {animation().name};
  const ImportedRig rig = import_rig(scene_, options);
  const double at = (seconds - rig.motions[0].start) * rig.motions[0].frames_per_second;
  const auto frame = as_size(at);
  const Points low = skinned(rig.character, rig.motions[0].motion.frames.at(frame)),
               high = skinned(rig.character, rig.motions[0].motion.frames.at(frame + 1));
  Points between;
  for (std::size_t v = 0; v < low.size(); ++v) between.push_back(low[v] + (at - std::floor(at)) * (high[v] - low[v]));
  EXPECT_LT(largest_error(between, rig.vertex_map, rig.file_from_character), 1e-4);
  RecordProperty("frames_per_second", std::to_string(rig.motions[0].frames_per_second));
}

TEST_P(RealRigs, WeldedVerticesMoveAsTheFile) {
  ImportRigOptions options;
  options.animations = {animation().name};
  options.weld = true;
  const ImportedRig rig = import_rig(scene_, options);
  EXPECT_LT(rig.motions[0].error, 3e-5);
  EXPECT_LE(rig.character.num_vertices(), scene_.num_vertices());
}

TEST_P(RealRigs, LandmarksAreTheJointsThatPeopleChose) {
  const Json chosen = Json::parse(read_file(folder_ / "truth.json"))["landmark_joint"];
  const ImportedRig rig = import_rig(scene_);
  const Scene& scene = scene_;
  for (std::size_t i = 0; i < kBodyLandmarks.size(); ++i) {
    std::string key = kBodyLandmarks[i];
    if (key.rfind("left_", 0) == 0) key = "l_" + key.substr(5);
    if (key.rfind("right_", 0) == 0) key = "r_" + key.substr(6);
    std::string expected = chosen[key].is_null() ? "" : chosen[key].get<std::string>();
    // `joint_k` is the k-th joint of the skin where joints have no names.
    if (expected.rfind("joint_", 0) == 0)
      expected = scene.nodes[scene.skins[0].joints[std::stoi(expected.substr(6))]].name;
    const int joint = rig.landmark_joint[i];
    EXPECT_EQ(joint < 0 ? "" : rig.joints[joint].name, expected) << key;
  }
}

TEST_P(RealRigs, TheTemplateStandsUpright) {
  const ImportedRig rig = import_rig(scene_);
  const auto position = [&](const char* landmark) {
    const auto found = std::find(kBodyLandmarks.begin(), kBodyLandmarks.end(), std::string(landmark));
    return rig.joints[rig.landmark_joint[found - kBodyLandmarks.begin()]].position;
  };
  const Eigen::Vector3d up = position("head") - position("pelvis"), left = position("left_hip") - position("right_hip");
  EXPECT_GT(up.normalized().y(), 0.95);
  EXPECT_LT(std::abs(left.normalized().y()), 0.1);
}

INSTANTIATE_TEST_SUITE_P(Real, RealRigs, support::rig_references(),
                         [](const auto& body) { return std::string(body.param); });

}  // namespace
}  // namespace doppel::real_rigs_test
