#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "doppel/io/scene/read_scene.h"
#include "doppel/io/scene/scene_mesh.h"
#include "support/gltf_writer.h"
#include "support/shared_folder.h"
#include "support/temporary_folder.h"

namespace doppel::mirrored_scenes_test {
namespace {

using support::GltfWriter;
using Json = GltfWriter::Json;

double signed_volume(const TriangleMesh& mesh) {
  double volume = 0;
  for (const Triangle& face : mesh.faces)
    volume += mesh.vertices[face[0]].dot(mesh.vertices[face[1]].cross(mesh.vertices[face[2]])) / 6;
  return volume;
}

/// A tetrahedron of 1/6 cubic metre whose faces are turned outwards, with UVs: node 0 is above the joint 1 and the
/// mesh 2. @param skinned whether the joint moves the mesh
GltfWriter tetrahedron(bool skinned) {
  GltfWriter file;
  const int positions = file.floats({0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1}, "VEC3", 3);
  const int uvs = file.floats({0, 0, 1, 0, 0, 1, 1, 1}, "VEC2", 2);
  const int indices = file.shorts({0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3});
  Json attributes = {{"POSITION", positions}, {"TEXCOORD_0", uvs}};
  file.json["nodes"] = {
      {{"name", "armature"}, {"children", {1, 2}}}, {{"name", "joint"}}, {{"name", "mesh"}, {"mesh", 0}}};
  if (skinned) {
    attributes["JOINTS_0"] = file.bytes(std::vector<std::uint8_t>(16, 0), "VEC4", 4);
    attributes["WEIGHTS_0"] = file.floats({1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}, "VEC4", 4);
    file.json["nodes"][2]["skin"] = 0;
    file.json["skins"] = {{{"joints", {1}}}};
  }
  file.json["meshes"] = {{{"primitives", {{{"attributes", attributes}, {"indices", indices}}}}}};
  return file;
}

TriangleMesh mesh_of(const GltfWriter& file) {
  const support::TemporaryFolder folder;
  file.write(folder / "figure.glb");
  return scene_mesh(read_scene(folder / "figure.glb"));
}

TEST(MirroredScenes, FacesTurnOutwardsUnderAnyScale) {
  for (const bool skinned : {false, true})
    for (const std::vector<double>& scale :
         std::vector<std::vector<double>>{{1, 1, 1}, {-1, 1, 1}, {1, -1, 1}, {1, 1, -2}, {-1, -1, 1}, {-1, -1, -1}}) {
      GltfWriter file = tetrahedron(skinned);
      file.json["nodes"][0]["scale"] = scale;
      const double volume = std::abs(scale[0] * scale[1] * scale[2]) / 6;
      EXPECT_NEAR(signed_volume(mesh_of(file)), volume, 1e-9) << scale[0] << " " << scale[1] << " " << scale[2];
      // The same as a matrix.
      file.json["nodes"][0] = {{"children", {1, 2}},
                               {"matrix", {scale[0], 0, 0, 0, 0, scale[1], 0, 0, 0, 0, scale[2], 0, 0, 0, 0, 1}}};
      EXPECT_NEAR(signed_volume(mesh_of(file)), volume, 1e-9);
    }
}

TEST(MirroredScenes, TwoMirrorsCancel) {
  for (const bool skinned : {false, true}) {
    GltfWriter file = tetrahedron(skinned);
    file.json["nodes"][0]["scale"] = {-1, 1, 1};
    file.json["nodes"][1]["scale"] = file.json["nodes"][2]["scale"] = {1, 1, -1};
    EXPECT_NEAR(signed_volume(mesh_of(file)), 1.0 / 6, 1e-9);
  }
}

// The joints move a skinned mesh; its own node does not.
TEST(MirroredScenes, TheJointsDecideForASkinnedMesh) {
  GltfWriter file = tetrahedron(true);
  file.json["nodes"][1]["scale"] = {-1, 1, 1};
  EXPECT_NEAR(signed_volume(mesh_of(file)), 1.0 / 6, 1e-9);
  file = tetrahedron(true);
  file.json["nodes"][2]["scale"] = {-1, 1, 1};
  EXPECT_NEAR(signed_volume(mesh_of(file)), 1.0 / 6, 1e-9);
  // An inverse bind matrix that mirrors too.
  file = tetrahedron(true);
  file.json["nodes"][1]["scale"] = {-1, 1, 1};
  file.json["skins"][0]["inverseBindMatrices"] =
      file.floats({-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}, "MAT4", 16);
  EXPECT_NEAR(signed_volume(mesh_of(file)), 1.0 / 6, 1e-9);
}

TEST(MirroredScenes, TextureCoordinatesStayAtTheirVertices) {
  GltfWriter file = tetrahedron(false);
  file.json["nodes"][0]["scale"] = {-1, 1, 1};
  const support::TemporaryFolder folder;
  file.write(folder / "figure.glb");
  const Scene scene = read_scene(folder / "figure.glb");
  EXPECT_EQ(scene.primitives.at(0).face_uvs, scene.primitives.at(0).faces);
}

class RealMirroredScenes : public support::SharedFolderTest {};

TEST_F(RealMirroredScenes, AMirroredFigureHasTheVolumeOfItsReference) {
  const std::filesystem::path folder = shared_ / "cases" / "18-glb-mirrored-figure-inside-out";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is missing";
  const double right = signed_volume(scene_mesh(read_scene(folder / "reference.glb")));
  EXPECT_GT(right, 0.01);
  EXPECT_NEAR(signed_volume(scene_mesh(read_scene(folder / "mirrored.glb"))), right, 1e-6 * right);
}

}  // namespace
}  // namespace doppel::mirrored_scenes_test
