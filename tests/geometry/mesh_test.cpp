#include "doppel/geometry/mesh.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "geometry/meshes.h"
#include "support/hostile_files.h"
#include "support/oriented_image.h"
#include "support/temporary_folder.h"

namespace doppel::mesh_test {
namespace {

using support::replaced;
using support::TemporaryFolder;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr const char* kObj =
    "# a quad and a triangle\n"
    "v 0 0 0\n"
    "v 1000 0 0\n"
    "v 1000 1000 0\n"
    "v 0 1000 0\n"
    "v 500 500 1e3\n"
    "vt 0 0\n"
    "vt 1 0\n"
    "vt 1 1\n"
    "vt 0 1\n"
    "vn 0 0 1\n"
    "g body\n"
    "s off\n"
    "f 1/1/1 2/2/1 3/3/1 4/4/1\n"
    "f -5/-4 -4/-3/1 -1/-1\n";

class ObjFile {
 public:
  TriangleMesh read(const std::string& text) {
    support::write_bytes(folder_ / "m.obj", text);
    return read_obj(folder_ / "m.obj", 0.001);
  }
  std::string refusal(const std::string& text) {
    return support::expect_rejects_or_reads("a changed file", [&] { read(text); });
  }
  std::string refusal(const std::string& from, const std::string& to) { return refusal(replaced(kObj, from, to)); }
  std::filesystem::path operator/(const std::string& name) const { return folder_ / name; }

 private:
  TemporaryFolder folder_;
};

TriangleMesh textured_sheet() {
  TriangleMesh mesh = support::make_sheet(3, 2);
  for (int v = 0; v < mesh.num_vertices(); ++v) {
    mesh.vertices[v] = mesh.vertices[v] / 3 + Eigen::Vector3d(0.1, 0.2, 0.3 + 0.01 * v);
    mesh.colours.emplace_back(v / 20.0, 1.0 / 3, 0.7);
  }
  for (int f = 0; f < mesh.num_faces(); ++f) {
    for (int corner = 0; corner < 3; ++corner) mesh.uvs.emplace_back(f / 17.0, corner / 3.0);
    mesh.face_uvs.push_back({3 * f, 3 * f + 1, 3 * f + 2});
  }
  mesh.texture = cv::Mat(4, 5, CV_8UC3);
  for (int i = 0; i < 60; ++i) mesh.texture.data[i] = static_cast<unsigned char>(4 * i);
  return mesh;
}

TEST(ObjReference, FansPolygonsAndCountsBackwards) {
  ObjFile file;
  for (const std::string& text : {std::string(kObj), support::with_crlf(kObj)}) {
    const TriangleMesh mesh = file.read(text);
    ASSERT_EQ(mesh.num_vertices(), 5);
    EXPECT_EQ(mesh.vertices[4], Eigen::Vector3d(0.5, 0.5, 1));
    EXPECT_THAT(mesh.faces, ElementsAre(Triangle{0, 1, 2}, Triangle{0, 2, 3}, Triangle{0, 1, 4}));
    EXPECT_THAT(mesh.face_uvs, ElementsAre(Triangle{0, 1, 2}, Triangle{0, 2, 3}, Triangle{0, 1, 3}));
    EXPECT_THAT(mesh.colours, IsEmpty());
    EXPECT_TRUE(mesh.texture.empty());
  }
}

TEST(ObjReference, VertexColours) {
  ObjFile file;
  const TriangleMesh some = file.read("v 0 0 0\nv 1 0 0 0.25 0.5 0.75\nv 0 1 0\nf 1 2 3\n");
  EXPECT_THAT(some.colours,
              ElementsAre(Eigen::Vector3d(1, 1, 1), Eigen::Vector3d(0.25, 0.5, 0.75), Eigen::Vector3d(1, 1, 1)));
  const TriangleMesh apart = file.read("v 0 0 0\nv 1 0 0\nv 0 1 0\nvc 0 0 1\nvc 0 1 0\nvc 1 0 0\nf 1 2 3\n");
  ASSERT_EQ(apart.colours.size(), 3u);
  EXPECT_EQ(apart.colours[2], Eigen::Vector3d(1, 0, 0));
}

TEST(ObjReference, FacesMayComeFirst) {
  ObjFile file;
  EXPECT_EQ(file.read("f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n").num_faces(), 1);
}

TEST(ObjReference, RoundTripsWithTexture) {
  const TemporaryFolder folder;
  const TriangleMesh mesh = textured_sheet();
  write_obj(folder / "sheet.obj", mesh, 1);
  const TriangleMesh again = read_obj(folder / "sheet.obj", 1);
  EXPECT_EQ(again.vertices, mesh.vertices);
  EXPECT_EQ(again.colours, mesh.colours);
  EXPECT_EQ(again.faces, mesh.faces);
  EXPECT_EQ(again.uvs, mesh.uvs);
  EXPECT_EQ(again.face_uvs, mesh.face_uvs);
  ASSERT_EQ(again.texture.size(), mesh.texture.size());
  EXPECT_EQ(cv::norm(again.texture, mesh.texture, cv::NORM_INF), 0);

  write_obj(folder / "mm.obj", mesh, 0.001);
  const TriangleMesh scaled = read_obj(folder / "mm.obj", 0.001);
  for (int v = 0; v < mesh.num_vertices(); ++v) EXPECT_LT((scaled.vertices[v] - mesh.vertices[v]).norm(), 1e-15);
}

TEST(ObjReference, MaterialFilesOfTheField) {
  const TemporaryFolder folder;
  const TriangleMesh mesh = textured_sheet();
  write_obj(folder / "sheet.obj", mesh, 1);
  std::string text = read_file(folder / "sheet.obj");
  support::write_bytes(folder / "other.obj", replaced(text, "mtllib sheet.mtl", "mtllib .\\my sheet.mtl"));
  support::write_bytes(
      folder / "my sheet.mtl",
      "# MeshLab\r\nnewmtl unused\r\nmap_Kd absent.png\r\nnewmtl material_0\r\nKd 1 1 1\r\nmap_Kd sheet.png\r\n");
  EXPECT_FALSE(read_obj(folder / "other.obj", 1).texture.empty());

  std::filesystem::remove(folder / "my sheet.mtl");
  EXPECT_TRUE(read_obj(folder / "other.obj", 1).texture.empty()) << "a missing material file is only a warning";
}

// As in Blender and MeshLab: the texture coordinates are those of the pixels as stored.
TEST(ObjReference, TexturesAreNotTurned) {
  const TemporaryFolder folder;
  write_obj(folder / "sheet.obj", textured_sheet(), 1);
  support::write_bytes(folder / "sheet.mtl", "newmtl material_0\nmap_Kd turned.jpg\n");
  cv::Mat shown(8, 16, CV_8UC3, cv::Scalar::all(20));
  shown.rowRange(0, 4) = cv::Scalar::all(200);
  for (const int orientation : {3, 6}) {
    support::write_bytes(folder / "turned.jpg", support::oriented_file(shown, ".jpg", orientation));
    const cv::Mat texture = read_obj(folder / "sheet.obj", 1).texture, stored = support::stored_for(shown, orientation);
    ASSERT_EQ(texture.size(), stored.size());
    EXPECT_LT(cv::norm(texture, stored, cv::NORM_INF), 40.0) << orientation;
  }
}

TEST(ObjRejects, BadFacesNamingTheLine) {
  ObjFile file;
  EXPECT_THAT(file.refusal("f 1/1/1", "f 0/1/1"), HasSubstr("m.obj:14: reading a mesh: \"0\" is not a vertex index"));
  EXPECT_THAT(file.refusal("f 1/1/1", "f 6/1/1"), HasSubstr("m.obj:14: reading a mesh: this face names vertex 6"));
  EXPECT_THAT(file.refusal("f 1/1/1", "f 1/5/1"), HasSubstr("names texture coordinate 5"));
  EXPECT_THAT(file.refusal("f -5", "f -6"), HasSubstr("m.obj:15: "));
  EXPECT_THAT(file.refusal("f 1/1/1", "f 1x/1/1"), HasSubstr("\"1x\""));
  EXPECT_THAT(file.refusal("f 1/1/1", "f 99999999999999999999/1/1"), HasSubstr("not a vertex index"));
  EXPECT_THAT(file.refusal("f 1/1/1", "f 3000000000/1/1"), HasSubstr("not a vertex index"));
  EXPECT_THAT(file.refusal("f 1/1/1", "f 1//1"), HasSubstr("some have none"));
  EXPECT_THAT(file.refusal("f -5/-4 -4/-3/1 -1/-1", "f -5 -4 -1"), HasSubstr("some have none"));
  EXPECT_THAT(file.refusal("f -5/-4 -4/-3/1 -1/-1", "f -5/-4 -4/-3"), HasSubstr("at least 3 corners, found 2"));
}

TEST(ObjRejects, BadNumbers) {
  ObjFile file;
  EXPECT_THAT(file.refusal("v 1000 0 0", "v 1000 nan 0"), HasSubstr("m.obj:3: reading a mesh: y must be finite"));
  EXPECT_THAT(file.refusal("v 1000 0 0", "v 1000 0"), HasSubstr("z is missing"));
  EXPECT_THAT(file.refusal("v 0 0 0\nv 1 0 0\n"), HasSubstr("2 vertices but no faces"));
  EXPECT_THROW(read_obj(file / "m.obj", 0), Error);
}

TEST(ObjRejects, BrokenTextures) {
  const TemporaryFolder folder;
  write_obj(folder / "sheet.obj", textured_sheet(), 1);
  const std::string png = read_file(folder / "sheet.png");
  support::write_bytes(folder / "sheet.png", "no image");
  EXPECT_THAT(support::expect_rejects_or_reads("", [&] { read_obj(folder / "sheet.obj", 1); }),
              HasSubstr("cannot be decoded"));
  std::filesystem::remove(folder / "sheet.png");
  EXPECT_THAT(support::expect_rejects_or_reads("", [&] { read_obj(folder / "sheet.obj", 1); }),
              HasSubstr("sheet.mtl:2: the texture"));
  support::write_bytes(folder / "sheet.png", png);
  support::write_bytes(folder / "b.png", png);
  support::write_bytes(folder / "sheet.mtl", "newmtl material_0\nmap_Kd sheet.png\nmap_Kd b.png\n");
  EXPECT_THAT(support::expect_rejects_or_reads("", [&] { read_obj(folder / "sheet.obj", 1); }),
              HasSubstr("uses 2 textures"));
}

TEST(ObjRejects, HostileFiles) {
  const TemporaryFolder folder;
  support::expect_survives_hostile_files(folder / "a.obj", kObj, [](const auto& path) { read_obj(path, 0.001); });
}

TEST(ObjRejects, MeshesThatCannotBeWritten) {
  const TemporaryFolder folder;
  TriangleMesh mesh = textured_sheet();
  mesh.colours.pop_back();
  EXPECT_THROW(write_obj(folder / "x.obj", mesh, 1), Error);
  mesh = textured_sheet();
  mesh.face_uvs.pop_back();
  EXPECT_THROW(write_obj(folder / "x.obj", mesh, 1), Error);
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(MeshReference, NormalsOfASphereAndOfLoneVertices) {
  TriangleMesh mesh = support::make_sphere(4, 2.0);
  mesh.vertices.emplace_back(5, 5, 5);
  const std::vector<Eigen::Vector3d> normals = vertex_normals(mesh);
  ASSERT_EQ(normals.size(), mesh.vertices.size());
  for (int v = 0; v + 1 < mesh.num_vertices(); ++v) {
    EXPECT_NEAR(normals[v].norm(), 1, 1e-12);
    EXPECT_GT(normals[v].dot(mesh.vertices[v] / 2), 0.999);
  }
  EXPECT_EQ(normals.back(), Eigen::Vector3d::Zero());
}

}  // namespace
}  // namespace doppel::mesh_test
