#include "support/scan_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <tuple>

#include "doppel/core/error.h"
#include "doppel/io/scene/read_scene.h"
#include "doppel/io/scene/scene_mesh.h"
#include "support/fbx_writer.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::scan_files_test {
namespace {

using support::coloured_box;
using support::message_of;
using support::PlyForm;
using support::PlyUvs;
using support::PlyWriter;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// A box with numbers that floats hold exactly: 1 wide, 2 high, 0.5 deep.
TriangleMesh box() { return coloured_box({-0.5, 0, 0.25}, {0.5, 2, 0.75}); }

class ScanFiles : public ::testing::Test {
 protected:
  Scene read(const std::string& name, const std::string& content) {
    support::write_bytes(folder_ / name, content);
    return read_scene(folder_ / name);
  }
  /// What the reader says, without the folder before the name of the file.
  std::string refusal(const std::string& name, const std::string& content) {
    const std::string message = message_of<FileError>([&] { read(name, content); });
    return message.substr(std::min(message.find(name), message.size()));
  }
  /// A PNG of one colour, BGR.
  void write_image(const std::string& name, const cv::Scalar& colour) {
    cv::imwrite((folder_ / name).string(), cv::Mat(4, 8, CV_8UC3, colour));
  }

  support::TemporaryFolder folder_;
};

/// The corners of each triangle as positions. The index of a vertex may differ between files.
std::vector<Eigen::Vector3d> corners_of(const std::vector<Eigen::Vector3d>& vertices,
                                        const std::vector<Triangle>& faces) {
  std::vector<Eigen::Vector3d> corners;
  for (const Triangle& face : faces)
    for (const int v : face) corners.push_back(vertices.at(static_cast<std::size_t>(v)));
  return corners;
}

std::vector<Eigen::Vector2d> corner_uvs(const std::vector<Eigen::Vector2d>& uvs, const std::vector<Triangle>& faces) {
  std::vector<Eigen::Vector2d> corners;
  for (const Triangle& face : faces)
    for (const int uv : face) corners.push_back(uvs.at(static_cast<std::size_t>(uv)));
  return corners;
}

void expect_box(const Scene& scene) {
  ASSERT_EQ(scene.primitives.size(), 1u);
  const ScenePrimitive& primitive = scene.primitives[0];
  EXPECT_EQ(primitive.vertices.size(), 8u);
  EXPECT_EQ(corners_of(primitive.vertices, primitive.faces), corners_of(box().vertices, box().faces));
  EXPECT_THAT(scene.warnings, IsEmpty());
}

void expect_box_uvs(const ScenePrimitive& primitive) {
  EXPECT_EQ(corner_uvs(primitive.uvs, primitive.face_uvs), corner_uvs(box().uvs, box().face_uvs));
}

TEST_F(ScanFiles, StlAsTextAndBytesIsTheSameBox) {
  for (const std::string& content :
       {support::stl_text(box()), support::stl_binary(box()), support::with_crlf(support::stl_text(box()))}) {
    const Scene scene = read("box.stl", content);
    expect_box(scene);
    EXPECT_EQ(scene.nodes.at(0).name, "box");
    EXPECT_FALSE(scene.metres_per_unit || scene.up) << "STL says neither unit nor axis";
    EXPECT_THAT(scene.primitives[0].uvs, IsEmpty());
  }
}

TEST_F(ScanFiles, BinaryStlMayBeginWithSolid) {
  std::string content = support::stl_binary(box());
  content.replace(0, 5, "solid");
  expect_box(read("box.stl", content));
}

TEST_F(ScanFiles, StlFaultsAreNamed) {
  const std::string text = support::stl_text(box()), binary = support::stl_binary(box());
  EXPECT_EQ(refusal("a.stl", support::replaced(text, "vertex -0.5 0 0.25", "vertex nan 0 0.25")),
            "a.stl:4: reading an STL file: x must be finite, found \"nan\"");
  EXPECT_EQ(refusal("a.stl", support::replaced(text, "endloop", "")),
            "a.stl:9: reading an STL file: 'facet' stands inside a facet, which has no end");
  EXPECT_EQ(refusal("a.stl", text.substr(0, text.find("endloop"))),
            "a.stl:7: reading an STL file: the file is truncated: its last facet has no end");
  EXPECT_EQ(refusal("a.stl", binary.substr(0, 600)),
            "a.stl: the file is truncated: its header announces 12 triangles (684 bytes), it has 600 bytes");
  std::string inf = binary;
  const float infinite = INFINITY;
  std::memcpy(inf.data() + 84 + 50 + 12, &infinite, 4);
  EXPECT_EQ(refusal("a.stl", inf), "a.stl: triangle 1 has a position that is not finite");
  EXPECT_EQ(refusal("a.stl", "solid empty\nendsolid empty\n"),
            "a.stl: the file holds no triangles, so there is no surface to read");
}

TEST_F(ScanFiles, PlyInEveryFormHasTheColoursOfItsVertices) {
  for (const PlyForm form : {PlyForm::text, PlyForm::little_endian, PlyForm::big_endian}) {
    const TriangleMesh mesh = box();
    const Scene scene = read("box.ply", PlyWriter(mesh, form).file());
    expect_box(scene);
    EXPECT_EQ(scene.primitives[0].vertices, mesh.vertices) << "the index of a vertex is that of the file";
    EXPECT_EQ(scene.primitives[0].colours, mesh.colours);
    EXPECT_THAT(scene.primitives[0].face_uvs, IsEmpty());
    EXPECT_FALSE(scene.metres_per_unit || scene.up) << "PLY says neither unit nor axis";
  }
}

TEST_F(ScanFiles, PlyHasUvsAtVerticesOrAtCorners) {
  write_image("skin.png", cv::Scalar(10, 20, 30));
  TriangleMesh mesh = box();
  mesh.colours.clear();
  for (const PlyForm form : {PlyForm::text, PlyForm::little_endian, PlyForm::big_endian})
    for (const PlyUvs uvs : {PlyUvs::vertices, PlyUvs::corners}) {
      const Scene scene = read("box.ply", PlyWriter(mesh, form, uvs, "skin.png").file());
      expect_box(scene);
      expect_box_uvs(scene.primitives[0]);
      EXPECT_THAT(scene.primitives[0].colours, IsEmpty());
      ASSERT_EQ(scene.primitives[0].material, 0);
      EXPECT_EQ(scene.materials.at(0).texture.size(), cv::Size(8, 4));
      EXPECT_EQ(scene_mesh(scene).texture.at<cv::Vec3b>(0, 0), cv::Vec3b(10, 20, 30));
    }
}

TEST_F(ScanFiles, PlyPolygonsBecomeFansAndOtherElementsAreLeftOut) {
  const Scene scene = read("a.ply",
                           "ply\nformat ascii 1.0\nelement camera 1\nproperty float f\nproperty list uchar int ids\n"
                           "element vertex 4\nproperty double x\nproperty double y\nproperty double z\n"
                           "property float red\nproperty float green\nproperty float blue\n"
                           "element face 1\nproperty list uchar int vertex_index\nend_header\n"
                           "1.5 2 7 8\n0 0 0 255 0 0\n1 0 0 0 255 0\n1 1 0 0 0 255\n0 1 0 51 51 51\n4 0 1 2 3\n");
  const ScenePrimitive& primitive = scene.primitives.at(0);
  EXPECT_THAT(primitive.faces, ::testing::ElementsAre(Triangle{0, 1, 2}, Triangle{0, 2, 3}));
  EXPECT_EQ(primitive.colours.at(0), Eigen::Vector3d(1, 0, 0)) << "0..255 in floats, as some scanners write";
  EXPECT_DOUBLE_EQ(primitive.colours.at(3).x(), 0.2);
}

TEST_F(ScanFiles, PlyFaultsAreNamed) {
  const TriangleMesh mesh = box();
  const std::string text = PlyWriter(mesh, PlyForm::text).file();
  EXPECT_EQ(refusal("a.ply", support::replaced(text, "element vertex 8", "element vertex 4000000000")),
            "a.ply: the header announces 'element vertex 4000000000', but the file has 504 bytes: it is truncated or "
            "damaged");
  EXPECT_EQ(refusal("a.ply", support::replaced(text, "property float z", "property float w")),
            "a.ply: the vertices have no property 'z'");
  EXPECT_EQ(refusal("a.ply", support::replaced(text, "3 0 2 1", "3 0 2 9")),
            "a.ply: triangle 0 of primitive 0 ('a') names vertex 9, but there are 8");
  EXPECT_EQ(refusal("a.ply", support::replaced(text, "3 0 2 1", "3 0 2 -1")),
            "a.ply: a face names vertex -1; vertices count from 0");
  EXPECT_EQ(refusal("a.ply", support::replaced(text, "-0.5 0 0.25", "nan 0 0.25")),
            "a.ply: vertex 0 of primitive 0 ('a') has a position that is not finite");
  EXPECT_EQ(refusal("a.ply", text.substr(0, text.size() - 20)),
            "a.ply: the file is truncated: it ends before its last row");
  const std::string binary = PlyWriter(mesh, PlyForm::little_endian).file();
  EXPECT_EQ(
      refusal("a.ply", binary.substr(0, binary.size() - 20)),
      "a.ply: a list 'vertex_indices' announces 3 numbers, but 5 bytes are left: the file is truncated or damaged");
}

/// The box as OBJ with two materials, the second from face 6 on.
std::string obj_text() {
  const TriangleMesh mesh = box();
  std::string text = "mtllib box.mtl\n";
  for (const Eigen::Vector3d& x : mesh.vertices) text += fmt::format("v {} {} {}\n", x.x(), x.y(), x.z());
  for (const Eigen::Vector2d& uv : mesh.uvs) text += fmt::format("vt {} {}\n", uv.x(), uv.y());
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    if (f % 6 == 0) text += f == 0 ? "usemtl shirt\n" : "usemtl trousers\n";
    text += "f";
    for (const int v : mesh.faces[f]) text += fmt::format(" {0}/{0}", v + 1);
    text += "\n";
  }
  return text;
}

TEST_F(ScanFiles, ObjHasSeveralMaterialsAndTextures) {
  write_image("shirt.png", cv::Scalar(10, 20, 30));
  write_image("trousers.png", cv::Scalar(40, 50, 60));
  support::write_bytes(folder_ / "box.mtl",
                       "newmtl shirt\nKd 0 0 0\nmap_Kd shirt.png\nnewmtl trousers\nmap_Kd -s 1 1 1 trousers.png\n");
  const Scene scene = read("box.obj", obj_text());
  expect_box(scene);
  const ScenePrimitive& primitive = scene.primitives[0];
  expect_box_uvs(primitive);
  EXPECT_EQ(primitive.vertices, box().vertices) << "the index of a vertex is that of the file";
  EXPECT_THAT(primitive.face_materials, ::testing::ElementsAre(0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1));
  ASSERT_EQ(scene.materials.size(), 2u);
  EXPECT_EQ(scene.materials[0].name, "shirt");
  EXPECT_EQ(scene.materials[0].colour, Eigen::Vector4d::Ones()) << "black beside a texture means nothing";
  EXPECT_EQ(scene.materials[0].texture.at<cv::Vec3b>(1, 1), cv::Vec3b(10, 20, 30));
  EXPECT_EQ(scene.materials[1].texture.at<cv::Vec3b>(1, 1), cv::Vec3b(40, 50, 60));
}

TEST_F(ScanFiles, ObjColoursStandInForTexturesThatAreMissing) {
  support::write_bytes(folder_ / "box.mtl",
                       "newmtl shirt\nKd 0.25 0.5 1\nmap_Kd absent.png\nnewmtl trousers\nKd 1 0 0\n");
  const Scene scene = read("box.obj", obj_text());
  EXPECT_THAT(scene.warnings, Contains(HasSubstr("'absent.png' of material 'shirt' is missing")));
  EXPECT_EQ(scene.materials.at(0).colour, Eigen::Vector4d(0.25, 0.5, 1, 1));
  EXPECT_EQ(scene.materials.at(1).colour, Eigen::Vector4d(1, 0, 0, 1));
  std::filesystem::remove(folder_ / "box.mtl");
  EXPECT_THAT(read("box.obj", obj_text()).warnings, Contains("the material file 'box.mtl' is missing"));
}

TEST_F(ScanFiles, ColladaSaysUnitAxisUvsAndMaterial) {
  for (const auto& [word, axis] : {std::pair{"X_UP", 'x'}, std::pair{"Y_UP", 'y'}, std::pair{"Z_UP", 'z'}}) {
    const Scene scene = read("box.dae", support::collada_file(box(), 0.0254, word));
    expect_box(scene);
    expect_box_uvs(scene.primitives[0]);
    EXPECT_EQ(scene.metres_per_unit, 0.0254);
    EXPECT_EQ(scene.up, axis);
    const auto placed = corners_of(posed_vertices(scene, node_transforms(scene)), scene.primitives[0].faces);
    const auto given = corners_of(box().vertices, box().faces);
    for (std::size_t i = 0; i < given.size(); ++i)
      EXPECT_LT((placed.at(i) - given[i]).norm(), 1e-6) << "the file's unit";
    ASSERT_EQ(scene.primitives[0].material, 0);
    EXPECT_EQ(scene.materials.at(0).name, "cloth");
    EXPECT_LT((scene.materials[0].colour - Eigen::Vector4d(0.2, 0.4, 0.6, 1)).norm(), 1e-6);
  }
  write_image("skin.png", cv::Scalar(10, 20, 30));
  const Scene textured = read("box.dae", support::collada_file(box(), 1, "Y_UP", "skin.png"));
  expect_box(textured);
  EXPECT_EQ(textured.materials.at(0).texture.at<cv::Vec3b>(1, 1), cv::Vec3b(10, 20, 30));
}

TEST_F(ScanFiles, FbxAsTextAndBytesIsTheSameArm) {
  const FbxNode arm = support::fbx_arm();
  for (const std::string& content : {support::fbx_text(arm), fbx_binary(arm, 7400, false), fbx_binary(arm, 7500, false),
                                     fbx_binary(arm, 7400, true)}) {
    const Scene scene = read("arm.fbx", content);
    EXPECT_EQ(scene.metres_per_unit, 0.01);
    EXPECT_EQ(scene.up, 'y');
    ASSERT_EQ(scene.primitives.size(), 1u);
    const ScenePrimitive& primitive = scene.primitives[0];
    EXPECT_THAT(primitive.faces, ::testing::ElementsAre(Triangle{0, 1, 2}, Triangle{0, 2, 3}, Triangle{3, 4, 5}));
    EXPECT_THAT(primitive.face_uvs, ::testing::ElementsAre(Triangle{0, 1, 2}, Triangle{0, 2, 3}, Triangle{0, 1, 2}));
    EXPECT_EQ(scene.skins.at(0).joints.size(), 2u);
    ASSERT_EQ(scene.animations.size(), 1u);
    EXPECT_EQ(scene.animations[0].name, "bend");
    // A quarter turn about z at height 100 takes the tip from (0, 200) to (-100, 100).
    const auto posed = posed_vertices(scene, node_transforms(scene, scene.animations[0], 1.0));
    EXPECT_LT((posed.back() - Eigen::Vector3d(-100, 100, 0)).norm(), 1e-9);
  }
}

TEST_F(ScanFiles, ColladaAttributesMayBeWrittenInEveryWay) {
  const std::string file = support::collada_file(box(), 0.01, "Y_UP");
  for (const char* meter : {"meter='0.01'", "meter = \"0.01\""}) {
    const Scene scene =
        read("box.dae", support::replaced(support::replaced(file, "meter=\"0.01\"", meter), "<asset>",
                                          "<asset><contributor><comments>Z_UP before</comments></contributor>"));
    EXPECT_EQ(scene.metres_per_unit, 0.01) << meter;
    EXPECT_EQ(scene.up, 'y') << "a comment is no axis";
  }
}

TEST_F(ScanFiles, ObjMayHaveCommentsBehindFacesAndTexturesOfOneNumber) {
  const Scene scene = read("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0\nvt 0.5\nvt 1\nf 1/1 2/2 3/3 # the only face\n");
  ASSERT_EQ(scene.primitives.at(0).faces.size(), 1u);
  EXPECT_EQ(scene.primitives[0].uvs.at(1), Eigen::Vector2d(0.5, 0));
}

/// The texture of a joined mesh where the middle of a triangle is.
cv::Vec3b drawn_at(const TriangleMesh& mesh, std::size_t face) {
  Eigen::Vector2d uv = Eigen::Vector2d::Zero();
  for (const int corner : mesh.face_uvs.at(face)) uv += mesh.uvs.at(static_cast<std::size_t>(corner)) / 3;
  EXPECT_GE(uv.minCoeff(), 0.0);
  EXPECT_LE(uv.maxCoeff(), 1.0);
  return mesh.texture.at<cv::Vec3b>(static_cast<int>((1 - uv.y()) * mesh.texture.rows),
                                    static_cast<int>(uv.x() * mesh.texture.cols));
}

TEST_F(ScanFiles, ATextureRepeatsBeyondItsBorders) {
  cv::Mat image(8, 8, CV_8UC3, cv::Scalar(0, 0, 255));
  image.colRange(4, 8) = cv::Scalar(0, 255, 0);
  cv::imwrite((folder_ / "halves.png").string(), image);
  support::write_bytes(folder_ / "a.mtl", "newmtl cloth\nmap_Kd halves.png\n");
  for (const double shift : {-2.0, 0.0, 1.0}) {
    std::string text = "mtllib a.mtl\nusemtl cloth\nv 0 0 0\nv 1 0 0\nv 0 1 0\n";
    for (const double u : {0.1, 0.4, 0.1, 0.6, 0.9, 0.6}) text += fmt::format("vt {} 0.5\n", u + shift);
    const TriangleMesh mesh = scene_mesh(read("a.obj", text + "f 1/1 2/2 3/3\nf 1/4 2/5 3/6\n"));
    EXPECT_EQ(drawn_at(mesh, 0), cv::Vec3b(0, 0, 255)) << shift;
    EXPECT_EQ(drawn_at(mesh, 1), cv::Vec3b(0, 255, 0)) << shift;
    if (shift == 0.0) EXPECT_EQ(mesh.texture.size(), image.size()) << "nothing to repeat";
  }
}

/// The curve of the arm's animation.
FbxNode arm_with_curve(std::vector<std::int64_t> times, std::vector<double> degrees, std::vector<std::int32_t> flags) {
  FbxNode arm = support::fbx_arm();
  for (FbxNode& record : arm.children)
    for (FbxNode& object : record.children) {
      if (object.name != "AnimationCurve") continue;
      const std::vector<std::int32_t> counts(flags.size(), 1);
      object.children = {{"KeyTime", {std::move(times)}, {}},
                         {"KeyValueFloat", {std::move(degrees)}, {}},
                         {"KeyAttrFlags", {std::move(flags)}, {}},
                         {"KeyAttrRefCount", {counts}, {}}};
      return arm;
    }
  return arm;
}

/// The turn of the arm's lower joint about z, degrees, -180 to 180.
double turn_at(const Scene& scene, double seconds) {
  const Eigen::Matrix3d turn = node_transforms(scene, scene.animations.at(0), seconds).at(2).linear();
  return std::atan2(turn(1, 0), turn(0, 0)) * 180 / M_PI;
}

TEST_F(ScanFiles, FbxAnglesAreInterpolatedAsNumbers) {
  const std::int64_t second = 46186158000;
  constexpr std::int32_t kHeld = 0x2, kLinear = 0x4;
  const Scene far = read("a.fbx", support::fbx_text(arm_with_curve({0, second}, {0, 200}, {kLinear, kLinear})));
  for (const double s : {0.1, 0.5, 0.85}) EXPECT_NEAR(turn_at(far, s), 200 * s, 1e-6) << "a long turn is no short one";
  const Scene held =
      read("a.fbx", support::fbx_text(arm_with_curve({0, second / 2, second}, {0, 60, 0}, {kHeld, kLinear, kLinear})));
  for (const double s : {0.1, 0.4, 0.49}) EXPECT_NEAR(turn_at(held, s), 0, 1e-6) << s;
  for (const double s : {0.5, 0.75, 0.9}) EXPECT_NEAR(turn_at(held, s), 120 * (1 - s), 1e-6) << s;
}

TEST_F(ScanFiles, FbxCountsTimeInTwoUnits) {
  for (const auto& [version, definition, ticks] :
       {std::tuple{7700, 127, 46186158000}, {7700, 0, 141120000}, {7500, 0, 46186158000}, {8000, 127, 141120000}}) {
    FbxNode arm = arm_with_curve({0, ticks}, {0, 90}, {0x4, 0x4});
    arm.children[0].children = {
        {"FBXVersion", {std::int64_t{version}}, {}},
        {"OtherFlags", {}, {{"TCDefinition", {std::int64_t{definition}}, {}}}},
    };
    EXPECT_NEAR(turn_at(read("a.fbx", support::fbx_text(arm)), 0.5), 45, 1e-6) << version << " " << definition;
  }
}

TEST_F(ScanFiles, FbxColoursBelongToVerticesOrCorners) {
  const auto colours_of = [&](const std::string& mapping, std::vector<double> colours,
                              std::vector<std::int32_t> indices) {
    FbxNode arm = support::fbx_arm();
    for (FbxNode& record : arm.children)
      for (FbxNode& object : record.children)
        if (object.name == "Geometry")
          object.children.push_back({"LayerElementColor",
                                     {std::int64_t{0}},
                                     {{"MappingInformationType", {mapping}, {}},
                                      {"Colors", {std::move(colours)}, {}},
                                      {"ColorIndex", {std::move(indices)}, {}}}});
    return read("a.fbx", support::fbx_text(arm)).primitives.at(0).colours;
  };
  const std::vector<double> red_and_blue{1, 0, 0, 1, 0, 0, 1, 1};
  const auto by_vertex = colours_of("ByVertice", red_and_blue, {0, 0, 0, 1, 1, 1});
  EXPECT_EQ(by_vertex.at(2), Eigen::Vector3d(1, 0, 0));
  EXPECT_EQ(by_vertex.at(3), Eigen::Vector3d(0, 0, 1));
  // The quad 0 1 2 3 is red, the triangle 3 4 5 blue. Vertex 3 is a corner of two triangles, one of each colour.
  const auto by_corner = colours_of("ByPolygonVertex", red_and_blue, {0, 0, 0, 0, 1, 1, 1});
  EXPECT_EQ(by_corner.at(0), Eigen::Vector3d(1, 0, 0));
  EXPECT_EQ(by_corner.at(3), Eigen::Vector3d(0.5, 0, 0.5));
  EXPECT_THAT(colours_of("ByVertice", {1, 1, 1, 1}, {0, 0, 0, 0, 0, 0}), IsEmpty()) << "white says nothing";
}

}  // namespace
}  // namespace doppel::scan_files_test
