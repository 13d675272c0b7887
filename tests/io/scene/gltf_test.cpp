#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "doppel/core/error.h"
#include "doppel/io/scene/read_scene.h"
#include "support/gltf_writer.h"
#include "support/message_of.h"
#include "support/oriented_image.h"

namespace doppel::gltf_test {
namespace {

using support::bending_arm;
using support::GltfWriter;
using ::testing::HasSubstr;
using Json = GltfWriter::Json;

class Gltf : public ::testing::Test {
 protected:
  std::filesystem::path path_ = std::filesystem::path(::testing::TempDir()) / "gltf_test.glb";
  void TearDown() override { std::filesystem::remove(path_); }
  Scene read(const GltfWriter& file) {
    file.write(path_);
    return read_scene(path_);
  }
  std::string error_of(const GltfWriter& file) {
    return support::message_of<FileError>([&] { read(file); });
  }
  static Eigen::Vector3d tip(const Scene& scene, double seconds) {
    return posed_vertices(scene, node_transforms(scene, scene.animations.at(0), seconds)).back();
  }
};

TEST_F(Gltf, LinearRotationsFollowTheArc) {
  const Scene scene = read(bending_arm());
  ASSERT_EQ(scene.animations.at(0).end, 1.0);
  for (const double seconds : {0.0, 0.25, 0.5, 1.0, 2.0}) {
    const double angle = std::min(seconds, 1.0) * M_PI / 2;
    EXPECT_LT((tip(scene, seconds) - Eigen::Vector3d(-std::sin(angle), 1 + std::cos(angle), 0)).norm(), 1e-6);
  }
}

TEST_F(Gltf, StepKeepsTheKeyBefore) {
  GltfWriter file = bending_arm();
  file.json["animations"][0]["samplers"][0]["interpolation"] = "STEP";
  const Scene scene = read(file);
  EXPECT_LT((tip(scene, 0.999) - Eigen::Vector3d(0, 2, 0)).norm(), 1e-6);
  EXPECT_LT((tip(scene, 1.0) - Eigen::Vector3d(-1, 1, 0)).norm(), 1e-6);
}

TEST_F(Gltf, CubicSplinesAreHermiteCurves) {
  GltfWriter file = bending_arm();
  const int times = file.floats({0, 2}, "SCALAR", 1);
  // In-tangent, value, out-tangent of each of two keys: x(s) with values 0 and 1, slopes 1 and 0 per second.
  const int values = file.floats({0, 0, 0, 0, 1, 0, 1, 0, 0, 0, 0, 0, 1, 1, 0, 0, 0, 0}, "VEC3", 3);
  file.json["animations"][0]["samplers"][0] = {{"input", times}, {"output", values}, {"interpolation", "CUBICSPLINE"}};
  file.json["animations"][0]["channels"][0]["target"]["path"] = "translation";
  const Scene scene = read(file);
  // Half way: p = 0.5 * 0 + 0.125 * 2 * 1 + 0.5 * 1 - 0.125 * 2 * 0.
  EXPECT_NEAR(tip(scene, 1.0).x(), 0.75, 1e-6);
}

TEST_F(Gltf, WeightsAreNormalisedAndVerticesWithoutThemFollowTheNode) {
  GltfWriter file = bending_arm();
  file.json["accessors"][2] = file.json["accessors"].at(static_cast<std::size_t>(
      file.floats({2, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0.2F, 0.2F, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}, "VEC4", 4)));
  const Scene scene = read(file);
  const ScenePrimitive& primitive = scene.primitives.at(0);
  EXPECT_EQ(primitive.vertex_joints.size(1), 0);
  EXPECT_EQ(primitive.vertex_joints.size(3), 2);
  EXPECT_DOUBLE_EQ(primitive.weights[0], 1.0);
  EXPECT_DOUBLE_EQ(primitive.weights[2], 0.5);
  EXPECT_THAT(scene.warnings, testing::Contains(HasSubstr("3 vertices do not sum to 1")));
}

TEST_F(Gltf, NodesGetNames) {
  GltfWriter file = bending_arm();
  file.json["nodes"][0].erase("name");
  file.json["nodes"][2]["name"] = "lower";
  const Scene scene = read(file);
  EXPECT_EQ(scene.nodes[0].name, "node_0");
  EXPECT_EQ(scene.nodes[1].name, "lower");
  EXPECT_EQ(scene.nodes[2].name, "lower_2");
}

TEST_F(Gltf, MaterialsHaveColourAndTexture) {
  GltfWriter file = bending_arm();
  cv::Mat red(2, 2, CV_8UC3, cv::Scalar(0, 0, 200));
  std::vector<std::uint8_t> png;
  cv::imencode(".png", red, png);
  file.json["images"] = {{{"bufferView", file.view(png)}, {"mimeType", "image/png"}}};
  file.json["textures"] = {{{"source", 0}}};
  file.json["materials"] = {
      {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}, {"baseColorFactor", {1, 0.5, 0, 1}}}}}};
  auto& primitive = file.json["meshes"][0]["primitives"][0];
  primitive["material"] = 0;
  primitive["attributes"]["TEXCOORD_0"] = file.floats({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC2", 2);
  const Scene scene = read(file);
  EXPECT_EQ(scene.materials.at(0).texture.at<cv::Vec3b>(0, 0), cv::Vec3b(0, 0, 200));
  EXPECT_NEAR(scene.materials[0].colour[1], 0.7354, 1e-4);             // sRGB of one half
  EXPECT_EQ(scene.primitives.at(0).uvs.at(2), Eigen::Vector2d(0, 0));  // v points up here, down in the file
}

TEST_F(Gltf, TexturesAreNotTurned) {
  cv::Mat shown(8, 16, CV_8UC3, cv::Scalar::all(20));
  shown.rowRange(0, 4) = cv::Scalar::all(200);
  for (const int orientation : {3, 6}) {
    GltfWriter file = bending_arm();
    const std::string jpeg = support::oriented_file(shown, ".jpg", orientation);
    file.json["images"] = {
        {{"bufferView", file.view(std::vector<std::uint8_t>(jpeg.begin(), jpeg.end()))}, {"mimeType", "image/jpeg"}}};
    file.json["textures"] = {{{"source", 0}}};
    file.json["materials"] = {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}};
    file.json["meshes"][0]["primitives"][0]["material"] = 0;
    const cv::Mat texture = read(file).materials.at(0).texture, stored = support::stored_for(shown, orientation);
    ASSERT_EQ(texture.size(), stored.size());
    EXPECT_LT(cv::norm(texture, stored, cv::NORM_INF), 40.0) << orientation;
  }
}

TEST_F(Gltf, SparseAccessorsReplaceRows) {
  GltfWriter file = bending_arm();
  const int row = file.shorts({5});
  const int value = file.floats({0, 3, 0}, "VEC3", 3);
  file.json["accessors"][0]["sparse"] = {
      {"count", 1},
      {"indices",
       {{"bufferView", file.json["accessors"][static_cast<std::size_t>(row)]["bufferView"]}, {"componentType", 5123}}},
      {"values", {{"bufferView", file.json["accessors"][static_cast<std::size_t>(value)]["bufferView"]}}}};
  EXPECT_EQ(read(file).primitives.at(0).vertices.at(5), Eigen::Vector3d(0, 3, 0));
}

TEST_F(Gltf, DamageIsNamed) {
  const auto changed = [](const auto& change) {
    GltfWriter file = bending_arm();
    change(file.json);
    return file;
  };
  EXPECT_THAT(error_of(changed([](Json& j) { j["nodes"][1]["children"] = {0}; })), HasSubstr("circle"));
  EXPECT_THAT(error_of(changed([](Json& j) { j["nodes"][1]["children"] = {7}; })), HasSubstr("has the child 7"));
  EXPECT_THAT(error_of(changed([](Json& j) { j["skins"][0]["joints"] = {0, 9}; })), HasSubstr("names the joint 9"));
  EXPECT_THAT(error_of(changed([](Json& j) { j["accessors"][0]["count"] = 1e15; })), HasSubstr("accessors[0].count"));
  EXPECT_THAT(error_of(changed([](Json& j) { j["accessors"][0]["count"] = 600; })), HasSubstr("needs"));
  EXPECT_THAT(error_of(changed([](Json& j) { j["accessors"][3]["count"] = -1; })), HasSubstr("count is -1"));
  EXPECT_THAT(error_of(changed([](Json& j) { j["bufferViews"][0]["byteOffset"] = 1e18; })),
              HasSubstr("covers the bytes"));
  EXPECT_THAT(error_of(changed([](Json& j) { j["accessors"][1]["type"] = "VEC2"; })), HasSubstr("expected 4"));
  EXPECT_THAT(error_of(changed([](Json& j) { j["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = 99; })),
              HasSubstr("POSITION"));
  EXPECT_THAT(error_of(changed([](Json& j) {
                j.erase("meshes");
                j["nodes"][2].erase("mesh");
              })),
              HasSubstr("no triangles"));
  EXPECT_THAT(error_of(changed([](Json& j) { j["asset"]["version"] = "1.0"; })), HasSubstr("only version 2.0"));
}

TEST_F(Gltf, NumbersThatAreNoneAreNamed) {
  GltfWriter file = bending_arm();
  file.json["accessors"][0] = file.json["accessors"].at(static_cast<std::size_t>(
      file.floats({0, 0, 0, 0.1F, 0, 0, NAN, 0.5F, 0, 0, 1, 0, 0.1F, 1, 0, 0, 2, 0}, "VEC3", 3)));
  EXPECT_THAT(error_of(file), HasSubstr("vertex 2 of primitive 0"));
  GltfWriter index = bending_arm();
  index.json["accessors"][3] = index.json["accessors"].at(static_cast<std::size_t>(index.shorts({0, 1, 2, 3, 4, 6})));
  EXPECT_THAT(error_of(index), HasSubstr("names vertex 6, but there are 6"));
  GltfWriter joint = bending_arm();
  joint.json["accessors"][1] = joint.json["accessors"].at(static_cast<std::size_t>(
      joint.bytes({0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 2, 0, 0, 0, 1, 0, 0, 0}, "VEC4", 4)));
  EXPECT_THAT(error_of(joint), HasSubstr("names joint 2 of its skin, which has 2"));
}

/// No byte that is cut off or changed may do more than cause an error.
TEST_F(Gltf, TruncatedAndDamagedFilesNeverCrash) {
  const std::string whole = bending_arm().glb();
  for (std::size_t size = 0; size < whole.size(); size += 7) {
    GltfWriter::write(path_, whole.substr(0, size));
    EXPECT_THROW(read_scene(path_), Error) << size;
  }
  unsigned state = 1;
  int read_anyway = 0;
  for (int round = 0; round < 2000; ++round) {
    std::string damaged = whole;
    for (int i = 0; i < 3; ++i) {
      state = state * 1664525U + 1013904223U;
      damaged[20 + (state >> 8) % (damaged.size() - 20)] = static_cast<char>(state >> 24);
    }
    GltfWriter::write(path_, damaged);
    try {
      const Scene scene = read_scene(path_);
      if (!scene.animations.empty()) node_transforms(scene, scene.animations[0], 0.5);
      ++read_anyway;
    } catch (const Error&) {
    }
  }
  EXPECT_GT(read_anyway, 0);
  EXPECT_LT(read_anyway, 2000);
}

TEST_F(Gltf, DeepNestingIsRefused) {
  std::string deep;
  for (int i = 0; i < 200'000; ++i) deep += "{\"a\":\n";
  for (const std::string& json : {deep, deep + "1" + std::string(200'000, '}')}) {
    GltfWriter::write(path_, json);
    EXPECT_EQ(support::message_of<FileError>([&] { read_scene(path_); }),
              path_.string() + ": the JSON of the glTF file is nested more than 64 deep");
  }
}

/// Numbering the copies of a name from 2 each time would take minutes here.
TEST_F(Gltf, ManyNodesMayHaveOneName) {
  GltfWriter file = bending_arm();
  constexpr int kNodes = 60'000;
  for (int i = 0; i < kNodes; ++i) file.json["nodes"].push_back({{"name", "bone"}});
  const Scene scene = read(file);
  EXPECT_EQ(scene.nodes.back().name, "bone_" + std::to_string(kNodes));
}

TEST_F(Gltf, ColoursOfVerticesAreTimesThatOfTheMaterial) {
  GltfWriter file = bending_arm();
  file.json["materials"] = {{{"pbrMetallicRoughness", {{"baseColorFactor", {1, 0.5, 0, 1}}}}}};
  auto& primitive = file.json["meshes"][0]["primitives"][0];
  primitive["material"] = 0;
  primitive["attributes"]["COLOR_0"] = file.floats(std::vector<float>(18, 0.5F), "VEC3", 3);
  const Eigen::Vector3d colour = read(file).primitives.at(0).colours.at(0);
  EXPECT_LT((colour - Eigen::Vector3d(0.7354, 0.5371, 0)).norm(), 1e-4);  // sRGB of 0.5, 0.25, 0
}

TEST_F(Gltf, MeshesOutsideOfTheSceneAreLeftOut) {
  GltfWriter file = bending_arm();
  file.json["nodes"].push_back({{"name", "spare"}, {"mesh", 0}});
  EXPECT_EQ(read(file).primitives.size(), 2u) << "no scene, so all";
  file.json["scenes"] = {{{"nodes", {3}}}, {{"nodes", {0, 2}}}};
  file.json["scene"] = 1;
  const Scene scene = read(file);
  ASSERT_EQ(scene.primitives.size(), 1u);
  EXPECT_EQ(scene.primitives[0].node, 2);
  EXPECT_THAT(scene.warnings, ::testing::Contains(HasSubstr("nodes[3] is not in the scene")));
  file.json["scenes"][1]["nodes"] = {9};
  EXPECT_THAT(error_of(file), HasSubstr("scenes[1] names the node 9, but the file has 4 nodes"));
}

TEST_F(Gltf, NamesOfFilesAreUris) {
  GltfWriter file = bending_arm();
  const std::string glb = file.glb(), buffer = glb.substr(glb.find("BIN") + 4);
  const std::filesystem::path folder = path_.parent_path(), scene = folder / "gltf_test.gltf";
  for (const auto& [uri, name] :
       {std::pair{"K%C3%B6rper%20%281%29.bin", "K\u00f6rper (1).bin"}, {"100%.bin", "100%.bin"}}) {
    file.json["buffers"] = {{{"byteLength", buffer.size()}, {"uri", uri}}};
    GltfWriter::write(folder / name, buffer);
    GltfWriter::write(scene, file.json.dump());
    EXPECT_EQ(read_scene(scene).primitives.size(), 1u) << uri;
    std::filesystem::remove(folder / name);
    std::filesystem::remove(scene);
  }
}

}  // namespace
}  // namespace doppel::gltf_test
