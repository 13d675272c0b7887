#include "doppel/io/rig_import/import_rig.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/io/rig_import/motions_json.h"
#include "doppel/io/scene/read_scene.h"
#include "support/gltf_writer.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::import_rig_test {
namespace {

using support::bending_arm;
using support::GltfWriter;
using ::testing::Contains;
using ::testing::HasSubstr;
using Json = GltfWriter::Json;

class ImportRig : public ::testing::Test {
 protected:
  support::TemporaryFolder folder_;
  Scene read(const GltfWriter& file) const {
    file.write(folder_ / "rig.glb");
    return read_scene(folder_ / "rig.glb");
  }
  static ImportRigOptions small() {
    ImportRigOptions options;
    options.nodes = 4;
    return options;
  }
  template <typename Change>
  std::string error_of(const Change& change) const {
    GltfWriter file = bending_arm();
    change(file.json);
    return support::message_of<Error>([&] { import_rig(read(file), small()); });
  }
};

TEST_F(ImportRig, ARunOfAxesPerJoint) {
  const ImportedRig rig = import_rig(read(bending_arm()), small());
  std::vector<std::string> names;
  for (const Joint& joint : rig.character.skeleton.joints) names.push_back(joint.name);
  EXPECT_EQ(names, (std::vector<std::string>{"upper_tx", "upper_ty", "upper_tz", "upper_ry", "upper_rz", "upper_rx",
                                             "lower_rx", "lower_ry", "lower_rz"}));
  EXPECT_EQ(rig.character.skeleton.root().axes, (std::array<int, 3>{1, 2, 0}));
  EXPECT_FALSE(rig.character.skeleton.dofs[3].limits);
  EXPECT_NEAR((*rig.character.skeleton.dofs[6].limits)[1], M_PI, 1e-12);
  EXPECT_EQ(rig.vertex_map, (std::vector<int>{0, 1, 2, 3, 4, 5}));
  EXPECT_EQ(rig.character.skin.bones, (std::vector<std::string>{"upper", "lower"}));
}

TEST_F(ImportRig, TheAnimationBecomesAMotion) {
  const ImportedRig rig = import_rig(read(bending_arm()), small());
  const ImportedMotion& motion = rig.motions.at(0);
  EXPECT_EQ(motion.file, "bend.motion");
  EXPECT_EQ(motion.frames_per_second, 600.0);
  EXPECT_EQ(motion.motion.num_frames(), 601);
  EXPECT_NEAR(motion.motion.frames[300][8], M_PI / 4, 1e-6);  // lower_rz half way
  EXPECT_LT(motion.error, 1e-6);
}

TEST_F(ImportRig, AJointThatSlidesGetsTranslations) {
  GltfWriter file = bending_arm();
  auto& animation = file.json["animations"][0];
  animation["samplers"][0]["output"] = file.floats({0, 1, 0, 0, 1.25F, 0}, "VEC3", 3);
  animation["channels"][0]["target"]["path"] = "translation";
  const ImportedRig rig = import_rig(read(file), small());
  const std::optional<int> slide = rig.character.skeleton.find_dof("lower_ty");
  ASSERT_TRUE(slide);
  EXPECT_FALSE(rig.character.skeleton.find_dof("lower_tx"));
  EXPECT_NEAR(rig.motions[0].motion.frames.back()[*slide], 250.0, 1e-3);  // millimetres
  EXPECT_LT(rig.motions[0].error, 1e-6);
}

TEST_F(ImportRig, UnitAndAxisAreTurnedToMetresAndYUp) {
  ImportRigOptions options = small();
  options.metres_per_unit = 0.5;
  options.up = 'z';
  GltfWriter file = bending_arm();
  file.json["nodes"][0]["rotation"] = {0.70710678, 0, 0, 0.70710678};  // y of the arm is z of the file
  const ImportedRig rig = import_rig(read(file), options);
  const auto pose = rig.character.skeleton.pose(rig.character.rest_dofs);
  EXPECT_LT((rig.character.mesh.vertices[5] - Eigen::Vector3d(0, 1, 0)).norm(), 1e-6);
  EXPECT_LT((pose.back().translation() - Eigen::Vector3d(0, 0.5, 0)).norm(), 1e-6);
  EXPECT_LT((rig.file_from_character * pose.back().translation() - Eigen::Vector3d(0, 0, 1)).norm(), 1e-6);
}

TEST_F(ImportRig, NamesFitTheFilesOfACharacter) {
  GltfWriter file = bending_arm();
  file.json["nodes"][0]["name"] = "upper arm_l";
  file.json["nodes"][1]["name"] = "upper-arm-l";
  file.json["animations"][0]["name"] = "a/b";
  const ImportedRig rig = import_rig(read(file), small());
  EXPECT_EQ(rig.joints[0].bone, "upper-arm-l");
  EXPECT_EQ(rig.joints[1].bone, "upper-arm-l-2");
  EXPECT_EQ(rig.motions[0].file, "a_b.motion");
}

TEST_F(ImportRig, WrittenAndReadBackItIsTheSame) {
  const ImportedRig rig = import_rig(read(bending_arm()), small());
  const std::filesystem::path out = folder_ / "out";
  const std::filesystem::path file = write_imported_rig(out, rig);
  const Character back = load_character(file);
  EXPECT_EQ(back.fingerprint(), rig.character.fingerprint());
  const auto joints = nlohmann::json::parse(read_file(out / "joints.json"));
  EXPECT_EQ(joints["joints"].size(), 21U);
  EXPECT_TRUE(joints["joints"]["pelvis"].is_null());
  EXPECT_EQ(joints["rig"][1]["position"][1], 1.0);
  EXPECT_EQ(nlohmann::json::parse(read_file(out / "motions.json"))["motions"][0]["file"], "bend.motion");
  EXPECT_FALSE(std::filesystem::exists(folder_ / ".out.partial"));
}

TEST_F(ImportRig, ItIsSkinnedLinearlyAsTheFileIs) {
  EXPECT_EQ(import_rig(read(bending_arm()), small()).character.skinning, SkinningMode::linear);
}

TEST_F(ImportRig, TheRateOfAMotionStandsBesideIt) {
  ImportRigOptions options = small();
  options.frames_per_second = 40.0;
  write_imported_rig(folder_ / "out", import_rig(read(bending_arm()), options));
  EXPECT_EQ(imported_rate(folder_ / "out" / "bend.motion"), 40.0);
  EXPECT_EQ(imported_rate(folder_ / "out" / "other.motion"), std::nullopt);
  EXPECT_EQ(imported_rate(folder_ / "bend.motion"), std::nullopt);
  for (const char* text : {"", "[]", R"({"motions": 3})", R"({"motions": [{"file": "bend.motion"}]})",
                           R"({"motions": [{"file": "bend.motion", "frames_per_second": -1}]})"}) {
    write_atomically(folder_ / "out" / "motions.json", text);
    EXPECT_THROW(imported_rate(folder_ / "out" / "bend.motion"), FileError) << text;
  }
}

TEST_F(ImportRig, NothingIsWrittenOverAnotherCharacter) {
  const ImportedRig rig = import_rig(read(bending_arm()), small());
  const std::filesystem::path out = folder_ / "taken";
  std::filesystem::create_directories(out);
  write_atomically(out / "segmentation.txt", "0\n");
  EXPECT_THROW(write_imported_rig(out, rig), UsageError);
  EXPECT_FALSE(std::filesystem::exists(out / "actor.character"));
}

TEST_F(ImportRig, WhatNoSkeletonCanHoldIsNamed) {
  EXPECT_EQ(error_of([](Json& j) { j["nodes"][2].erase("skin"); }),
            "the file has 3 nodes and 6 vertices, but no surface with a skin, so there is no rig to import; `doppel "
            "character create` rigs a surface without one");
  EXPECT_EQ(
      error_of([](Json& j) {
        j["nodes"][1]["scale"] = {-1, 1, 1};
      }),
      "joint 'lower' is mirrored (negative scale) against its bind pose; apply the scale in the program that made "
      "the file, and export it again");
  EXPECT_EQ(
      error_of([](Json& j) {
        j["nodes"][1]["scale"] = {1, 2, 1};
      }),
      "joint 'lower' is sheared against its bind pose (stretched by 2 and 1 in two directions); apply the scale in "
      "the program that made the file, and export it again");
  EXPECT_EQ(
      error_of([](Json& j) {
        j["nodes"][1]["scale"] = {1, 1, 0};
      }),
      "joint 'lower' is sheared against its bind pose (stretched by 1 and 0 in two directions); apply the scale in "
      "the program that made the file, and export it again");
  EXPECT_THAT(error_of([](Json& j) { j["nodes"][0].erase("children"); }), HasSubstr("no common node"));
}

TEST_F(ImportRig, AnAnimationWithoutKeysIsRefusedWhereItIsAskedFor) {
  GltfWriter file = bending_arm();
  file.json["animations"].push_back({{"name", "still"}, {"channels", Json::array()}, {"samplers", Json::array()}});
  EXPECT_EQ(import_rig(read(file), small()).motions.size(), 1u) << "unasked, it is left out";
  ImportRigOptions options = small();
  options.animations = {"still"};
  EXPECT_EQ(support::message_of<UsageError>([&] { import_rig(read(file), options); }),
            "the animation 'still' of the file has no keys that move a node, so there is no motion to import");
}

TEST_F(ImportRig, AKeyAfterYearsIsRefused) {
  GltfWriter file = bending_arm();
  file.json["animations"][0]["samplers"][0]["input"] = file.floats({0, 1e9F}, "SCALAR", 1);
  ImportRigOptions options = small();
  options.frames_per_second = 25;
  EXPECT_EQ(support::message_of<Error>([&] { import_rig(read(file), options); }),
            "animation 'bend' lasts from 0 s to 1e+09 s, which is 2.5e+10 frames at 25 per second; at most 500000 are "
            "sampled. Correct the times of its keys, or give a lower rate (--fps)");
}

TEST_F(ImportRig, AnUnknownAnimationListsTheOthers) {
  ImportRigOptions options = small();
  options.animations = {"walk"};
  EXPECT_THAT(support::message_of<UsageError>([&] { import_rig(read(bending_arm()), options); }), HasSubstr("'bend'"));
}

TEST_F(ImportRig, StretchedJointsAreMeasured) {
  GltfWriter file = bending_arm();
  auto& animation = file.json["animations"][0];
  animation["samplers"][0]["output"] = file.floats({1, 1, 1, 1.5F, 1.5F, 1.5F}, "VEC3", 3);
  animation["channels"][0]["target"]["path"] = "scale";
  const ImportedRig rig = import_rig(read(file), small());
  EXPECT_NEAR(rig.motions[0].error, 0.5, 1e-6);
  EXPECT_THAT(rig.warnings, Contains(HasSubstr("stretches joints")));
}

}  // namespace
}  // namespace doppel::import_rig_test
