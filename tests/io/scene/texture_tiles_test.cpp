#include "doppel/io/scene/texture_tiles.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "doppel/io/scene/read_scene.h"
#include "doppel/io/scene/tile_name.h"
#include "support/hostile_files.h"
#include "support/shared_folder.h"
#include "support/temporary_folder.h"

namespace doppel::texture_tiles_test {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(TextureTiles, NamesAreCounted) {
  const auto name = [](const char* written, int u, int v) {
    const auto tiles = tile_name_of(written);
    return tiles ? tiles->of(u, v) : std::string("none");
  };
  EXPECT_EQ(name("tex.<UDIM>.png", 0, 0), "tex.1001.png");
  EXPECT_EQ(name("maps/tex_<udim>.png", 3, 2), "maps/tex_1024.png");
  EXPECT_EQ(name("tex.%(UDIM)d.png", 9, 0), "tex.1010.png");
  EXPECT_EQ(name("tex.<UVTILE>.png", 0, 1), "tex.u1_v2.png");
  EXPECT_EQ(name("tex.1001.png", 1, 0), "tex.1002.png");
  EXPECT_EQ(name("1999/body1012_v2.png", 0, 0), "1999/body1001_v2.png");
  EXPECT_EQ(name("tex_u1_v1.png", 1, 0), "tex_u2_v1.png");
  EXPECT_EQ(name("tex_u0_v0.png", 1, 0), "tex_u1_v0.png");
  for (const char* other : {"tex.png", "", "tex.10011.png", "tex.2048.png", "1001/tex.png", "cu1_v1.png", "u1_v.png"})
    EXPECT_EQ(name(other, 0, 0), "none") << other;
}

class TileFiles : public ::testing::Test {
 protected:
  void SetUp() override {
    write("red.png", cv::Scalar(0, 0, 255));
    text_ = "mtllib quads.mtl\nusemtl skin\n";
    // A square in each tile (u, v), one above the other.
    for (const auto& [u, v] : {std::pair(0, 0), {1, 0}, {0, 1}}) {
      for (const auto& [x, y] : {std::pair(0, 0), {1, 0}, {1, 1}, {0, 1}}) {
        text_ += fmt::format("v {} {} {}\n", x, y, count_);
        text_ += fmt::format("vt {} {}\n", u + 0.1 + 0.8 * x, v + 0.1 + 0.8 * y);
      }
      text_ += "f -4/-4 -3/-3 -2/-2 -1/-1\n";
      ++count_;
    }
  }
  void write(const std::string& name, const cv::Scalar& colour) {
    cv::imwrite((folder_ / name).string(), cv::Mat(4, 4, CV_8UC3, colour));
  }
  Scene read(const std::string& texture) {
    support::write_bytes(folder_ / "quads.mtl", "newmtl skin\nKd 1 1 1\nmap_Kd " + texture + "\n");
    support::write_bytes(folder_ / "quads.obj", text_);
    return read_scene(folder_ / "quads.obj");
  }
  /// The colour of the texture (BGR) of each square, black where it has none.
  std::vector<cv::Vec3b> colours(const Scene& scene) const {
    std::vector<cv::Vec3b> found;
    const ScenePrimitive& primitive = scene.primitives.at(0);
    for (std::size_t f = 0; f < primitive.faces.size(); f += 2) {
      const int material = primitive.face_materials.empty() ? primitive.material : primitive.face_materials[f];
      const cv::Mat& texture = scene.materials.at(material).texture;
      found.push_back(texture.empty() ? cv::Vec3b() : texture.at<cv::Vec3b>(1, 1));
    }
    return found;
  }

  support::TemporaryFolder folder_;
  std::string text_;
  int count_ = 0;
};

const cv::Vec3b kRed(0, 0, 255), kBlue(255, 0, 0), kGreen(0, 255, 0);

TEST_F(TileFiles, EachTileHasItsImage) {
  write("tex.1001.png", kRed);
  write("tex.1002.png", kBlue);
  write("tex.1011.png", kGreen);
  for (const char* name : {"tex.<UDIM>.png", "tex.1001.png", "tex.<udim>.png", "gone/tex.<UDIM>.png", "tex.1002.png"}) {
    const Scene scene = read(name);
    EXPECT_THAT(colours(scene), ElementsAre(kRed, kBlue, kGreen)) << name;
    EXPECT_THAT(scene.warnings, IsEmpty());
    EXPECT_EQ(scene.materials.size(), 3u);
  }
}

TEST_F(TileFiles, TheNumberingOfMudboxAndZbrush) {
  write("tex_u1_v1.png", kRed);
  write("tex_u2_v1.png", kBlue);
  write("tex_u1_v2.png", kGreen);
  for (const char* name : {"tex_u1_v1.png", "tex_<UVTILE>.png"})
    EXPECT_THAT(colours(read(name)), ElementsAre(kRed, kBlue, kGreen)) << name;
}

TEST_F(TileFiles, AMissingTileIsNamed) {
  write("tex.1001.png", kRed);
  write("tex.1011.png", kGreen);
  for (const char* name : {"tex.<UDIM>.png", "tex.1001.png"}) {
    const Scene scene = read(name);
    EXPECT_THAT(colours(scene), ElementsAre(kRed, cv::Vec3b(), kGreen)) << name;
    EXPECT_THAT(scene.warnings, ElementsAre(HasSubstr("tile 'tex.1002.png' of the texture of material 'skin'")));
  }
  EXPECT_THAT(read("other.<UDIM>.png").warnings, Contains(HasSubstr("other.<UDIM>.png")));
}

TEST_F(TileFiles, ANumberWithoutFurtherFilesRepeats) {
  write("scan_1024.png", kBlue);
  for (const char* name : {"red.png", "scan_1024.png"}) {
    const Scene scene = read(name);
    EXPECT_EQ(scene.materials.size(), 1u);
    EXPECT_THAT(scene.primitives[0].face_materials, IsEmpty());
    EXPECT_THAT(scene.warnings, IsEmpty());
  }
}

// The name of a texture begins behind the options, and both may have blanks.
TEST_F(TileFiles, OptionsAndBlanksInTheLineOfATexture) {
  for (const char* name : {"my tex (1).png", "1 2 3.png", "a  b.png", "-weird name.png"}) write(name, kGreen);
  for (const char* line :
       {"my tex (1).png", "-s 1 1 1 -o 0 0 0 my tex (1).png", "-s 1 1 my tex (1).png", "-o 0.5 my tex (1).png",
        "-clamp on -blendu off my tex (1).png", "-mm 0 1 -bm 1.0 my tex (1).png", "-imfchan r my tex (1).png",
        "-texres 512 -t 0 0 0 my tex (1).png", "\"my tex (1).png\"", "-s 1 1 1 \"my tex (1).png\"",
        "-colorspace sRGB my tex (1).png", "-unknown 3 4 my tex (1).png", "-unknown my tex (1).png", "my tex (1).png  ",
        "-s\t1\t1\t1\tmy tex (1).png", "a  b.png", "1 2 3.png", "-weird name.png", "-s 1 1 1 1 2 3.png"}) {
    const Scene scene = read(line);
    EXPECT_THAT(colours(scene), ::testing::Each(kGreen)) << line;
    EXPECT_THAT(scene.warnings, IsEmpty()) << line;
  }
  EXPECT_THAT(read("-s 1 1 1 absent file.png").warnings, Contains(HasSubstr("'absent file.png'")));
}

class RealTextureTiles : public support::SharedFolderTest {};

TEST_F(RealTextureTiles, TilesAndNamesWithBlanksAreFound) {
  const std::filesystem::path cases = shared_ / "cases";
  if (!std::filesystem::exists(cases)) GTEST_SKIP() << cases << " is missing";
  const Scene tiles = read_scene(cases / "12-obj-udim" / "udim_token.obj");
  ASSERT_EQ(tiles.materials.size(), 2u);
  EXPECT_THAT(tiles.warnings, IsEmpty());
  EXPECT_EQ(tiles.materials[0].texture.at<cv::Vec3b>(0, 0), kRed);
  EXPECT_EQ(tiles.materials[1].texture.at<cv::Vec3b>(0, 0), kBlue);
  const Scene named = read_scene(cases / "13-mtl-texture-name-with-blanks-and-options" / "a.obj");
  EXPECT_FALSE(named.materials.at(0).texture.empty());
  EXPECT_THAT(named.warnings, IsEmpty());
}

}  // namespace
}  // namespace doppel::texture_tiles_test
