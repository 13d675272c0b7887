#include <gtest/gtest.h>

#include <cstring>
#include <regex>
#include <tuple>
#include <vector>

#include "doppel/core/atomic_file.h"
#include "doppel/io/figure_export/key_frames.h"
#include "doppel/io/figure_export/write_figure.h"
#include "support/temporary_folder.h"

namespace doppel::figure_files_test {
namespace {

using support::TemporaryFolder;

TriangleMesh square() {
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  mesh.faces = {{0, 1, 2}, {0, 2, 3}};
  mesh.uvs = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  mesh.face_uvs = mesh.faces;
  mesh.texture = cv::Mat(4, 4, CV_8UC3, cv::Scalar(1, 2, 3));
  return mesh;
}

FigureClip three_frames() {
  FigureClip clip;
  clip.frames_per_second = 50.0;
  for (int t = 0; t < 3; ++t) {
    clip.dofs.push_back({});
    clip.vertices.emplace_back();
    for (int i = 0; i < 12; ++i) clip.vertices.back().push_back(0.25F * static_cast<float>(i) + static_cast<float>(t));
  }
  return clip;
}

/// Four bytes of a file as a word.
std::uint32_t word(const std::string& bytes, std::size_t at, bool big_endian) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i)
    value |= static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[at + i])) << (8 * (big_endian ? 3 - i : i));
  return value;
}
float real(const std::string& bytes, std::size_t at, bool big_endian) {
  const std::uint32_t bits = word(bytes, at, big_endian);
  float value = 0.0F;
  std::memcpy(&value, &bits, 4);
  return value;
}

TEST(KeyFrames, CornersAreKept) {
  const std::vector<double> values{0, 1, 2, 3, 2, 1, 0, 0, 0};  // corners at 3 and 6
  const auto error = [&](int a, int b, int i) {
    const double line = values[static_cast<std::size_t>(a)] +
                        (values[static_cast<std::size_t>(b)] - values[static_cast<std::size_t>(a)]) * (i - a) / (b - a);
    return std::abs(values[static_cast<std::size_t>(i)] - line);
  };
  EXPECT_EQ(key_frames(9, 1e-9, error), (std::vector<int>{0, 3, 6, 8}));
  EXPECT_EQ(key_frames(9, 10.0, error), (std::vector<int>{0, 8}));
  EXPECT_EQ(key_frames(1, 0.0, error), (std::vector<int>{0}));
}

TEST(PointCaches, HoldHeadAndPositions) {
  const TemporaryFolder folder;
  const FigureClip clip = three_frames();
  write_pc2(folder / "a.pc2", clip);
  const std::string pc2 = read_file(folder / "a.pc2");
  ASSERT_EQ(pc2.size(), 32U + 3 * 12 * 4);
  EXPECT_EQ(pc2.substr(0, 12), std::string("POINTCACHE2\0", 12));
  EXPECT_EQ(word(pc2, 12, false), 1U);
  EXPECT_EQ(word(pc2, 16, false), 4U);
  EXPECT_EQ(word(pc2, 28, false), 3U);
  EXPECT_EQ(real(pc2, 32 + 4 * (12 + 5), false), 2.25F);
  write_mdd(folder / "a.mdd", clip);
  const std::string mdd = read_file(folder / "a.mdd");
  ASSERT_EQ(mdd.size(), 8U + 3 * 4 + 3 * 12 * 4);
  EXPECT_EQ(word(mdd, 0, true), 3U);
  EXPECT_EQ(word(mdd, 4, true), 4U);
  EXPECT_EQ(real(mdd, 8 + 4, true), 0.02F);
  EXPECT_EQ(real(mdd, 20 + 4 * (24 + 11), true), 4.75F);
}

TEST(PointCaches, HaveTheGivenUnitAndVerticalAxis) {
  const TemporaryFolder folder;
  const FigureClip clip = three_frames();
  const FileSpace half_metres{0.5, true};
  write_pc2(folder / "a.pc2", clip, half_metres);
  write_mdd(folder / "a.mdd", clip, half_metres);
  const std::string pc2 = read_file(folder / "a.pc2"), mdd = read_file(folder / "a.mdd");
  const std::vector<float>& frame = clip.vertices[1];  // after 12 numbers of the frame before
  for (const auto& [bytes, head, big_endian] : {std::tuple{pc2, 32U, false}, std::tuple{mdd, 20U, true}}) {
    EXPECT_EQ(real(bytes, head + 4 * (12 + 3), big_endian), 2 * frame[3]);
    EXPECT_EQ(real(bytes, head + 4 * (12 + 4), big_endian), -2 * frame[5]);
    EXPECT_EQ(real(bytes, head + 4 * (12 + 5), big_endian), 2 * frame[4]);
  }
}

TEST(Usda, HoldsTopologyPointsAndMaterial) {
  const TemporaryFolder folder;
  const TriangleMesh mesh = square();
  const FigureClip clip = three_frames();
  write_usda(folder / "a.usda", {"my actor", mesh, clip});
  const std::string text = read_file(folder / "a.usda");
  EXPECT_EQ(text.substr(0, 10), "#usda 1.0\n");
  EXPECT_NE(text.find("defaultPrim = \"my_actor\""), std::string::npos);
  EXPECT_NE(text.find("endTimeCode = 2"), std::string::npos);
  EXPECT_NE(text.find("timeCodesPerSecond = 50"), std::string::npos);
  EXPECT_NE(text.find("int[] faceVertexIndices = [0, 1, 2, 0, 2, 3]"), std::string::npos);
  EXPECT_NE(text.find("2: [(2, 2.25, 2.5), (2.75, 3, 3.25)"), std::string::npos);
  EXPECT_NE(text.find("asset inputs:file = @./a.png@"), std::string::npos);
  EXPECT_NE(text.find("float3[] extent.timeSamples = {\n            0: [(0, 0.25, 0.5), (2.25, 2.5, 2.75)],\n"),
            std::string::npos);
  EXPECT_TRUE(std::filesystem::exists(folder / "a.png"));
  const auto count = [&](char c) { return std::count(text.begin(), text.end(), c); };
  EXPECT_EQ(count('{'), count('}'));
  EXPECT_EQ(count('('), count(')'));
  EXPECT_EQ(count('['), count(']'));
}

TEST(Usda, ColoursOfVerticesAreLinear) {
  const TemporaryFolder folder;
  TriangleMesh mesh = square();
  mesh.texture.release();
  mesh.colours.assign(4, Eigen::Vector3d(1, 0.5, 0));
  write_usda(folder / "a.usda", {"actor", mesh, three_frames()});
  EXPECT_NE(read_file(folder / "a.usda").find("color3f[] primvars:displayColor = [(1, 0.21404, 0), (1, 0.21404, 0)"),
            std::string::npos);
}

TEST(Usda, NormalsArePerpendicularToTheFacesOfEachFrame) {
  const TemporaryFolder folder;
  const TriangleMesh mesh = square();
  FigureClip clip;
  clip.dofs.assign(2, {});
  clip.vertices = {{0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}, {0, 0, 0, 0, 0, -1, 0, 1, -1, 0, 1, 0}};  // along z, then x
  write_usda(folder / "a.usda", {"actor", mesh, clip});
  const std::string text = read_file(folder / "a.usda"), normals = text.substr(text.find("normals.timeSamples"));
  EXPECT_NE(normals.find("0: [(0.0000, 0.0000, 1.0000), (0.0000, 0.0000, 1.0000), "), std::string::npos) << normals;
  EXPECT_NE(normals.find("1: [(1.0000, 0.0000, 0.0000), (1.0000, 0.0000, 0.0000), "), std::string::npos) << normals;
  EXPECT_NE(text.find("def Xform \"actor\" (\n    kind = \"component\"\n)\n"), std::string::npos);
}

}  // namespace
}  // namespace doppel::figure_files_test
