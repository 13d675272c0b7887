#include "doppel/character/character.h"

#include <gmock/gmock.h>

#include <fstream>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "support/test_character.h"

namespace doppel::character_test {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class CharacterFolder : public ::testing::Test {
 protected:
  CharacterFolder() { path_ = write_character(folder_.path(), character_); }

  fs::path file(const std::string& name) const { return folder_.path() / name; }
  void replace(const std::string& name, const std::string& from, const std::string& to) {
    std::string text = read_file(file(name));
    const auto at = text.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    support::write_bytes(file(name), text.replace(at, from.size(), to));
  }
  std::string refusal() {
    return support::message_of<Error>([&] { load_character(path_); });
  }

  const Character character_ = make_test_character();
  support::TemporaryFolder folder_;
  fs::path path_;
};
using CharacterReads = CharacterFolder;
using CharacterRejects = CharacterFolder;

TEST_F(CharacterReads, WhatWasWrittenIsTheSameCharacter) {
  const Character c = load_character(path_);
  EXPECT_EQ(c.name, character_.name);
  EXPECT_EQ(c.mesh.vertices, character_.mesh.vertices);
  EXPECT_EQ(c.mesh.faces, character_.mesh.faces);
  EXPECT_EQ(c.mesh.uvs, character_.mesh.uvs);
  EXPECT_EQ(c.mesh.face_uvs, character_.mesh.face_uvs);
  EXPECT_EQ(c.rest_dofs, character_.rest_dofs);
  EXPECT_EQ(c.skin.weights, character_.skin.weights);
  EXPECT_EQ(c.bone_joint, character_.bone_joint);
  EXPECT_EQ(c.labels, character_.labels);
  EXPECT_EQ(c.rigidity, character_.rigidity);
  EXPECT_EQ(c.graph.node_vertex, character_.graph.node_vertex);
  EXPECT_EQ(c.graph.edges, character_.graph.edges);
  EXPECT_EQ(c.graph.weights, character_.graph.weights);
  EXPECT_EQ(c.graph_source.filename(), "tube_graph.obj");
  EXPECT_EQ(c.fingerprint(), character_.fingerprint());
  EXPECT_EQ(c.skeleton.marker_reading, MarkerReading::joint_relative);
}

TEST_F(CharacterReads, AFolderWithOneCharacterStandsForIt) {
  EXPECT_EQ(load_character(folder_.path()).fingerprint(), character_.fingerprint());
  EXPECT_EQ(read_character_skeleton(folder_.path()).num_dofs(), character_.num_dofs());
  fs::copy(path_, file("other.character"));
  EXPECT_THAT(support::message_of<UsageError>([&] { load_character(folder_.path()); }),
              HasSubstr("2 .character files; name one of them, for example other.character"));
  const support::TemporaryFolder empty;
  EXPECT_THAT(support::message_of<UsageError>([&] { load_character(empty.path()); }),
              HasSubstr("a folder without a .character file"));
}

TEST_F(CharacterReads, FilesAreTheSameWhenWrittenAgain) {
  const support::TemporaryFolder other;
  write_character(other.path(), load_character(path_));
  for (const char* name : {"tube.skeleton", "tube.skin", "tube.motion", "tube.obj", "tube_graph.obj", "tube.character",
                           "segmentation.txt"})
    EXPECT_EQ(read_file(other.path() / name), read_file(file(name))) << name;
}

TEST_F(CharacterReads, KeywordsInAnyOrderBackslashesAndNoPose) {
  fs::create_directory(file("parts"));
  fs::rename(file("tube.skin"), file("parts/tube.skin"));
  support::write_bytes(path_,
                       "skeletool character file v1.0\r\nskin\r\n  .\\parts\\tube.skin\r\nmesh\r\n  ./tube.obj\r\n"
                       "skeleton\r\n  tube.skeleton\r\n");
  const Character c = load_character(path_);
  EXPECT_EQ(c.rest_dofs, std::vector<double>(c.num_dofs(), 0.0));
  EXPECT_EQ(c.skin.weights, character_.skin.weights);
}

TEST_F(CharacterReads, TheSkinningModeItWasWrittenWith) {
  EXPECT_EQ(load_character(path_).skinning, SkinningMode::dual_quaternion);
  EXPECT_EQ(read_file(path_).find("skinning"), std::string::npos);
  Character linear = load_character(path_);
  linear.skinning = SkinningMode::linear;
  const support::TemporaryFolder other;
  const Character c = load_character(write_character(other.path(), linear));
  EXPECT_EQ(c.skinning, SkinningMode::linear);
  EXPECT_EQ(c.fingerprint(), linear.fingerprint());
  EXPECT_NE(c.fingerprint(), character_.fingerprint());
}

TEST_F(CharacterReads, GraphNamesOfTheDatasets) {
  for (const char* name : {"tubeSimplified.obj", "simplified.obj", "other_graph.obj"}) {
    fs::rename(load_character(path_).graph_source, file(name));
    EXPECT_EQ(load_character(path_).graph_source.filename(), name);
  }
}

TEST_F(CharacterReads, WithoutAGraphFileTheTemplateIsDecimated) {
  fs::remove(file("tube_graph.obj"));
  CharacterOptions options;
  options.num_nodes = 60;
  const Character c = load_character(path_, options);
  EXPECT_TRUE(c.graph_source.empty());
  EXPECT_NEAR(c.num_nodes(), 60, 3);
}

TEST_F(CharacterReads, WithoutASegmentationRigidityIsOne) {
  fs::remove(file("segmentation.txt"));
  const Character c = load_character(path_);
  EXPECT_TRUE(c.labels.empty());
  EXPECT_EQ(c.rigidity, std::vector<double>(c.num_vertices(), 1.0));
}

TEST_F(CharacterReads, MarkersWrittenInTheWorldOfTheZeroPoseAreRecognised) {
  // The same markers, stated as world positions: only the reading that puts them back at the body can be meant.
  Skeleton stated = character_.skeleton;
  const auto zero = stated.pose(std::vector<double>(stated.num_dofs(), 0.0));
  for (Marker& marker : stated.markers) marker.position = zero[marker.joint] * marker.position;
  write_skeleton(file("tube.skeleton"), stated);
  const Character c = load_character(path_);
  EXPECT_EQ(c.skeleton.marker_reading, MarkerReading::zero_pose_world);
  for (std::size_t m = 0; m < stated.markers.size(); ++m)
    EXPECT_LT((c.skeleton.markers[m].position - character_.skeleton.markers[m].position).norm(), 1e-12);
  // And so again when such a character is written.
  const support::TemporaryFolder other;
  const Character again = load_character(write_character(other.path(), c));
  EXPECT_EQ(again.skeleton.marker_reading, MarkerReading::zero_pose_world);
  EXPECT_LT((again.skeleton.markers[0].position - c.skeleton.markers[0].position).norm(), 1e-12);
}

TEST_F(CharacterReads, TheSkeletonLiesInTheTemplateUnlessThePoseIsWrong) {
  Character c = load_character(path_);
  EXPECT_LT(skeleton_distance(c), 0.1);
  c.rest_dofs[0] += 2.0;  // two metres along x
  EXPECT_GT(skeleton_distance(c), 1.5);
}

TEST_F(CharacterReads, TheBoneRuleIsAnOption) {
  Skeleton longer = character_.skeleton;
  longer.joints.push_back({"Seg2Tip", Joint::Type::revolute, longer.num_joints() - 1, Eigen::Vector3d(0, 0.1, 0),
                           Eigen::Vector3d::UnitX()});
  write_skeleton(file("tube.skeleton"), longer);
  CharacterOptions prefix;
  prefix.bone_rule = BoneRule::prefix;
  EXPECT_EQ(load_character(path_).bone_joint[2], *longer.find_joint("Seg2_rx"));
  EXPECT_EQ(load_character(path_, prefix).bone_joint[2], *longer.find_joint("Seg2Tip"));
  EXPECT_NE(load_character(path_).fingerprint(), load_character(path_, prefix).fingerprint());
}

TEST_F(CharacterRejects, PartsThatDisagree) {
  const Character other = make_test_character(5, 8, 19);
  write_skin(file("tube.skin"), other.skin);
  EXPECT_THAT(refusal(), AllOf(HasSubstr("tube.skin"), HasSubstr("tube.obj"), HasSubstr("154"), HasSubstr("162")));
  write_skin(file("tube.skin"), character_.skin);
  write_segmentation(file("segmentation.txt"), other.labels);
  EXPECT_THAT(refusal(), AllOf(HasSubstr("segmentation.txt"), HasSubstr("154"), HasSubstr("162")));
  write_segmentation(file("segmentation.txt"), character_.labels);
  write_skeleton(file("tube.skeleton"), make_test_character(6).skeleton);
  EXPECT_THAT(refusal(), AllOf(HasSubstr("tube.motion:2"), HasSubstr("DoFs")));
  fs::remove(file("tube.motion"));
  replace("tube.character", "pose\n  tube.motion\n", "");
  write_skeleton(file("tube.skeleton"), make_test_character(4).skeleton);
  EXPECT_THAT(refusal(), AllOf(HasSubstr("tube.skin"), HasSubstr("tube.skeleton"), HasSubstr("Seg4")));
}

TEST_F(CharacterRejects, AGraphFinerThanTheTemplateAndTwoGraphs) {
  write_obj(file("tube_graph.obj"), make_test_character(5, 8, 30).mesh, 0.001);
  EXPECT_THAT(refusal(), AllOf(HasSubstr("tube_graph.obj"), HasSubstr("coarser")));
  fs::rename(file("tube_graph.obj"), file("a_graph.obj"));
  fs::copy_file(file("a_graph.obj"), file("b_graph.obj"));
  EXPECT_THAT(refusal(), HasSubstr("two graphs"));
}

TEST_F(CharacterRejects, FaultsOfTheFileItself) {
  const std::string text = read_file(path_);
  const auto with = [&](const std::string& from, const std::string& to) {
    support::write_bytes(path_, text);
    replace("tube.character", from, to);
    return refusal();
  };
  EXPECT_THAT(with("v1.0", "v0.3"), HasSubstr("character:1: unsupported version"));
  EXPECT_THAT(with("skeletool character file v1.0", "hello"), HasSubstr("character:1: not a character file"));
  EXPECT_THAT(with("skin\n", "bones\n"), HasSubstr("'bones' is not known"));
  EXPECT_THAT(with("tube.obj", "cube.obj"), HasSubstr("does not exist"));
  EXPECT_THAT(with("skin\n", "mesh\n"), HasSubstr("second time"));
  EXPECT_THAT(with("skin\n  tube.skin\n", ""), HasSubstr("names no skin"));
  EXPECT_THAT(with("pose\n", "skinning\n  cubic\npose\n"), HasSubstr("'cubic' is no skinning; give linear or"));
  EXPECT_THAT(with("pose\n  tube.motion\n", "pose\n"), HasSubstr("ends"));
  EXPECT_THROW(load_character(file("none.character")), FileError);
}

TEST(CharacterWrites, OnlyWhatCanBeReadBack) {
  const support::TemporaryFolder folder;
  Character nameless = make_test_character();
  nameless.name.clear();
  EXPECT_THROW(write_character(folder.path(), nameless), Error);
  Character faceless = make_test_character();
  faceless.graph.faces.clear();
  EXPECT_THROW(write_character(folder.path(), faceless), Error);
  Character unlabelled = make_test_character();
  unlabelled.labels.clear();
  write_character(folder.path(), make_test_character());
  EXPECT_THROW(write_character(folder.path(), unlabelled), Error);
}

TEST(CharacterReference, TheFingerprintFollowsWhatShapesAModel) {
  const Character character = make_test_character();
  const std::string fingerprint = character.fingerprint();
  EXPECT_EQ(fingerprint.size(), 16u);
  EXPECT_EQ(make_test_character().fingerprint(), fingerprint);
  EXPECT_NE(make_test_character(5, 8, 20, 2).fingerprint(), fingerprint);
  Character changed = character;
  changed.skeleton.dofs[3].name = "turn";
  EXPECT_NE(changed.fingerprint(), fingerprint);
  changed = character;
  std::swap(changed.graph.node_vertex[0], changed.graph.node_vertex[1]);
  EXPECT_NE(changed.fingerprint(), fingerprint);
  changed = character;
  std::swap(changed.mesh.faces[0][0], changed.mesh.faces[0][1]);
  EXPECT_NE(changed.fingerprint(), fingerprint);
  changed = character;
  changed.skin.weights[4] += 1e-4;
  EXPECT_NE(changed.fingerprint(), fingerprint);
  changed = character;
  changed.mesh.vertices[0].x() += 1e-9;
  EXPECT_EQ(changed.fingerprint(), fingerprint);
}

TEST(CharacterReference, TheTestCharacterHasWhatItPromises) {
  for (const int joints : {2, 3, 5}) {
    const Character c = make_test_character(joints, 5, 9);
    EXPECT_TRUE(inspect_mesh(c.mesh).closed());
    EXPECT_EQ(inspect_mesh(c.mesh).euler_characteristic, 2);
    double volume = 0.0;  // positive when faces are counter-clockwise from outside
    for (const Triangle& f : c.mesh.faces)
      volume += c.mesh.vertices[f[0]].dot(c.mesh.vertices[f[1]].cross(c.mesh.vertices[f[2]])) / 6.0;
    EXPECT_GT(volume, 0.0);
    EXPECT_EQ(c.skin.num_vertices(), c.num_vertices());
    EXPECT_NE(c.rest_dofs, std::vector<double>(c.num_dofs(), 0.0));
    EXPECT_LT(c.num_nodes(), c.num_vertices());
  }
}

TEST(CharacterInCodeRejects, CountsThatDisagreeInCode) {
  Character character = make_test_character();
  character.rest_dofs.pop_back();
  EXPECT_THROW(complete_character(character), Error);
  character.rest_dofs.clear();
  complete_character(character);
  EXPECT_EQ(static_cast<int>(character.rest_dofs.size()), character.num_dofs());
  character.skin.bones[1] = "Nobody";
  EXPECT_THROW(complete_character(character), Error);
  character = make_test_character();
  character.mesh.vertices.pop_back();
  EXPECT_THROW(complete_character(character), Error);
}

}  // namespace
}  // namespace doppel::character_test
