#include "doppel/io/figure_export/vrm.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/gltf_pose.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::vrm_test {
namespace {

const std::vector<std::string> kBones{"root",          "hips",         "spine",        "chest",         "head",
                                      "leftUpperLeg",  "leftLowerLeg", "leftFoot",     "rightUpperLeg", "rightLowerLeg",
                                      "rightFoot",     "leftUpperArm", "leftLowerArm", "leftHand",      "rightUpperArm",
                                      "rightLowerArm", "rightHand",    "LeftHandThumb"};

Figure figure_of(const std::vector<std::string>& names) {
  Figure figure;
  for (const std::string& name : names)
    figure.nodes.push_back({name, static_cast<int>(figure.nodes.size()) - 1, static_cast<int>(figure.nodes.size())});
  return figure;
}

TEST(Vrm, NamesBonesAndAuthors) {
  const tinygltf::Value vrm = vrm_extension(figure_of(kBones), "anna", {{"Anna", "Ben"}, "https://example.org/l"}, 5);
  EXPECT_EQ(vrm.Get("specVersion").Get<std::string>(), "1.0");
  const tinygltf::Value& meta = vrm.Get("meta");
  EXPECT_EQ(meta.Get("name").Get<std::string>(), "anna");
  EXPECT_EQ(meta.Get("authors").Get(1).Get<std::string>(), "Ben");
  EXPECT_EQ(meta.Get("licenseUrl").Get<std::string>(), "https://vrm.dev/licenses/1.0/");
  EXPECT_EQ(meta.Get("otherLicenseUrl").Get<std::string>(), "https://example.org/l");
  const tinygltf::Value& bones = vrm.Get("humanoid").Get("humanBones");
  ASSERT_TRUE(bones.IsObject());
  EXPECT_EQ(bones.Keys().size(), 16U);
  for (std::size_t i = 1; i + 1 < kBones.size(); ++i)
    EXPECT_EQ(bones.Get(kBones[i]).Get("node").GetNumberAsInt(), 5 + static_cast<int>(i)) << kBones[i];
}

TEST(Vrm, KnowsTheBonesOfFingers) {
  EXPECT_EQ(vrm_fingers().size(), 30U);
  EXPECT_EQ(vrm_fingers().at("LeftHandThumb1"), "leftThumbMetacarpal");
  EXPECT_EQ(vrm_fingers().at("RightHandThumb2"), "rightThumbProximal");
  EXPECT_EQ(vrm_fingers().at("LeftHandIndex1"), "leftIndexProximal");
  EXPECT_EQ(vrm_fingers().at("RightHandPinky2"), "rightLittleIntermediate");
  EXPECT_EQ(vrm_fingers().at("LeftHandRing3"), "leftRingDistal");
  std::vector<std::string> names = kBones;
  names.back() = "rightLittleIntermediate";
  const tinygltf::Value vrm = vrm_extension(figure_of(names), "anna", {{"Anna"}, ""}, 5);
  EXPECT_EQ(vrm.Get("humanoid").Get("humanBones").Get("rightLittleIntermediate").Get("node").GetNumberAsInt(),
            5 + static_cast<int>(kBones.size()) - 1);
}

TEST(Vrm, SaysWhichBonesAreMissing) {
  std::vector<std::string> names = kBones;
  names[4] = "skull";
  names[13] = "paw";
  EXPECT_THAT(support::message_of([&] {
                vrm_extension(figure_of(names), "anna", {{"Anna"}, ""}, 1);
              }),
              ::testing::HasSubstr("requires: head, leftHand;"));
  EXPECT_THAT(support::message_of([&] { vrm_extension(figure_of(kBones), "anna", {}, 1); }),
              ::testing::HasSubstr("--author NAME"));
}

using Eigen::Vector3d;

/// A body that looks along x, with lowered bent arms and legs apart. A twist bone divides the left upper arm. The nodes
/// have axes of their own.
Figure lowered_figure() {
  struct Bone {
    const char* name;
    int parent;
    Vector3d at;
  };
  const std::vector<Bone> bones{{"hips", -1, {0.5, 0.95, 2.0}},
                                {"spine", 0, {0, 0.1, 0}},
                                {"head", 1, {0, 0.5, 0}},
                                {"leftUpperArm", 1, {0, 0.4, -0.2}},
                                {"twist", 3, {0, -0.1, -0.1}},
                                {"leftLowerArm", 4, {0, -0.1, -0.1}},
                                {"leftHand", 5, {0.1, -0.2, -0.05}},
                                {"rightUpperArm", 1, {0, 0.4, 0.2}},
                                {"rightLowerArm", 7, {0, -0.2, 0.2}},
                                {"rightHand", 8, {0.1, -0.2, 0.05}},
                                {"leftUpperLeg", 0, {0, -0.05, -0.1}},
                                {"leftLowerLeg", 10, {0, -0.4, -0.1}},
                                {"leftFoot", 11, {-0.05, -0.4, -0.05}},
                                {"rightUpperLeg", 0, {0, -0.05, 0.1}},
                                {"rightLowerLeg", 13, {0, -0.4, 0.1}},
                                {"rightFoot", 14, {-0.05, -0.4, 0.05}}};
  Figure figure;
  for (const Bone& bone : bones) {
    const int number = static_cast<int>(figure.nodes.size());
    figure.nodes.push_back({bone.name, bone.parent, number});
    const Vector3d above = bone.parent < 0 ? Vector3d::Zero() : Vector3d(figure.rest[bone.parent].translation());
    figure.rest.emplace_back(Eigen::Translation3d(above + bone.at) *
                             Eigen::AngleAxisd(0.4 * number, Vector3d(1, 2, number).normalized()));
  }
  return figure;
}

/// The direction from one node to another in a pose.
Vector3d bone_of(const Figure& figure, const std::vector<Eigen::Affine3d>& nodes, const std::string& from,
                 const std::string& to) {
  std::map<std::string, Vector3d> at;
  for (std::size_t i = 0; i < nodes.size(); ++i) at[figure.nodes[i].name] = nodes[i].translation();
  return (at.at(to) - at.at(from)).normalized();
}

TEST(Vrm, StandsInATPose) {
  const Figure figure = lowered_figure();
  const std::vector<Eigen::Affine3d> posed = t_pose(figure);
  const auto bone = [&](const char* from, const char* to) { return bone_of(figure, posed, from, to); };
  for (const auto& [side, out] : {std::pair("left", 1.0), std::pair("right", -1.0)}) {
    const std::string s = side;
    for (const auto& [from, to] : {std::pair("UpperArm", "LowerArm"), std::pair("LowerArm", "Hand")})
      EXPECT_LT((bone((s + from).c_str(), (s + to).c_str()) - Vector3d(out, 0, 0)).norm(), 1e-9) << s << from;
    for (const auto& [from, to] : {std::pair("UpperLeg", "LowerLeg"), std::pair("LowerLeg", "Foot")})
      EXPECT_LT((bone((s + from).c_str(), (s + to).c_str()) - Vector3d(0, -1, 0)).norm(), 1e-9) << s << from;
  }
  // It looks along z: what was along x is along z. Feet turn with the body alone, and bones keep their lengths.
  const Eigen::Matrix3d heading = Eigen::AngleAxisd(-M_PI / 2, Vector3d::UnitY()).toRotationMatrix();
  EXPECT_LT((heading * Vector3d::UnitX() - Vector3d::UnitZ()).norm(), 1e-9);
  for (const std::size_t i : {0U, 1U, 2U, 12U, 15U})
    EXPECT_LT((posed[i].linear() - heading * figure.rest[i].linear()).norm(), 1e-9) << figure.nodes[i].name;
  for (std::size_t i = 1; i < posed.size(); ++i) {
    const auto length = [&](const std::vector<Eigen::Affine3d>& nodes) {
      return (nodes[i].translation() - nodes[static_cast<std::size_t>(figure.nodes[i].parent)].translation()).norm();
    };
    EXPECT_NEAR(length(posed), length(figure.rest), 1e-9);
  }
  EXPECT_NEAR(posed[12].translation().y(), figure.rest[12].translation().y(), 1e-9);
}

TEST(Vrm, OnlyTheRestOfTheNodesDiffersFromAPlainFile) {
  const support::TemporaryFolder folder;
  Figure figure = lowered_figure();
  TriangleMesh mesh;
  mesh.vertices = {{0.5, 1.0, 2.0}, {0.5, 1.0, 1.6}, {0.6, 1.2, 1.7}};
  mesh.faces = {{0, 1, 2}};
  figure.rest_vertices = mesh.vertices;
  figure.node.assign(3, {0, 5, 0, 0});
  figure.weight.assign(3, {0.5F, 0.5F, 0.0F, 0.0F});
  FigureClip clip;
  clip.dofs.assign(1, {});
  FigureTracks tracks;
  for (std::size_t i = 0; i < figure.nodes.size(); ++i) {
    tracks.rotation.push_back({Eigen::Quaterniond(Eigen::AngleAxisd(0.1 * i, Vector3d::UnitX()))});
    tracks.translation.push_back({Vector3d(0.01 * i, 0.2, 0.0)});
    tracks.rotation_keys.push_back({0});
    tracks.translation_keys.push_back({0});
  }
  write_glb(folder / "plain.glb", {"anna", mesh, clip}, figure, {}, tracks);
  write_glb(folder / "avatar.glb", {"anna", mesh, clip, {{"Anna"}, ""}}, figure, {}, tracks);
  const support::GltfPose plain(folder / "plain.glb"), avatar(folder / "avatar.glb");
  const auto posed = plain.vertices(0.0), found = avatar.vertices(0.0);
  for (std::size_t v = 0; v < posed.size(); ++v) EXPECT_LT((posed[v] - found[v]).norm(), 1e-9);
  const auto inverse = [](const support::GltfPose& file) {
    return file.rows(file.json["skins"][0]["inverseBindMatrices"].get<int>());
  };
  EXPECT_EQ(inverse(plain), inverse(avatar));
  EXPECT_EQ(plain.json["meshes"], avatar.json["meshes"]);
  EXPECT_NE(plain.json["nodes"], avatar.json["nodes"]);
  // The nodes of the avatar stand in the T-pose.
  std::vector<Eigen::Affine3d> world;
  for (std::size_t i = 0; i < figure.nodes.size(); ++i) {
    const auto& node = avatar.json["nodes"][i + 1];
    const auto turn = node["rotation"].get<std::vector<double>>(), at = node["translation"].get<std::vector<double>>();
    const Eigen::Affine3d local = Eigen::Translation3d(at[0], at[1], at[2]) * Eigen::Quaterniond(turn.data());
    const int parent = figure.nodes[i].parent;
    world.push_back(parent < 0 ? local : world[static_cast<std::size_t>(parent)] * local);
  }
  EXPECT_LT((bone_of(figure, world, "leftUpperArm", "leftHand") - Vector3d::UnitX()).norm(), 1e-6);
}

TEST(Vrm, RefusesAFigureBeforeItsFrames) {
  std::vector<std::string> names = kBones;
  names[2] = "belly";
  EXPECT_THAT(support::message_of([&] {
                check_avatar(figure_of(names), "anna", {{"Anna"}, ""});
              }),
              ::testing::HasSubstr("requires: spine;"));
  check_avatar(figure_of(names), "anna", {});  // no avatar
}

}  // namespace
}  // namespace doppel::vrm_test
