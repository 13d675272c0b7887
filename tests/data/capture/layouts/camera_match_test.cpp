#include "doppel/data/capture/layouts/camera_match.h"

#include <gtest/gtest.h>

#include "doppel/data/capture/layouts/name_words.h"
#include "doppel/detect/keypoints/frame_names.h"

namespace doppel::camera_match_test {
namespace {

using Names = std::vector<std::string>;
using Way = CameraMatch::Way;

TEST(NameWordsReference, OneRuleForAllNames) {
  for (const char* name : {"cam_01", "Cam-1", "cam1", "CAM 001", "cam.1"})
    EXPECT_EQ(normalised_name(name), "cam1") << name;
  EXPECT_EQ(normalised_name("int_cam01_img"), "intcam1img");
  EXPECT_EQ(normalised_name("c_0"), "c0");
  EXPECT_EQ(normalised_name("00_17"), "0_17") << "two numbers stay apart";
  EXPECT_EQ(normalised_name("GX010123"), "gx10123");
  EXPECT_EQ(normalised_name("---"), "");
}

TEST(NameWordsReference, NumbersAreOrderedByValue) {
  EXPECT_TRUE(natural_less("cam2", "cam10"));
  EXPECT_FALSE(natural_less("cam10", "cam2"));
  EXPECT_TRUE(natural_less("cam", "cam1"));
  EXPECT_FALSE(natural_less("a", "a"));
  EXPECT_NE(natural_less("a01", "a1"), natural_less("a1", "a01")) << "an order of all texts";
}

struct Case {
  const char* what;
  Names cameras, paths;
  Way way;
  std::vector<std::optional<int>> expected;
};

TEST(CameraMatchReference, FindsTheCamerasOfFiles) {
  const std::vector<Case> cases{
      {"separators and zeros", {"cam_01", "cam_02"}, {"videos/cam02", "videos/cam01"}, Way::name, {{1, 0}}},
      {"the number inside a longer name",
       {"int_cam01_img", "int_cam02_img"},
       {"v/cam01", "v/cam02"},
       Way::number,
       {{0, 1}}},
      {"c_0", {"0", "1"}, {"img/c_0", "img/c_1"}, Way::name, {{0, 1}}},
      {"cam1 is not cam10", {"cam1", "cam10"}, {"cam10", "cam1"}, Way::name, {{1, 0}}},
      {"a folder for each camera", {"1", "2"}, {"cam1/video_0001", "cam2/video_0001"}, Way::name, {{0, 1}}},
      {"the same number in every name", {"1", "2"}, {"walk1_cam1", "walk1_cam2"}, Way::name, {{0, 1}}},
      {"words", {"left", "right"}, {"walk/right", "walk/left"}, Way::name, {{1, 0}}},
      {"two numbers", {"00_03", "01_03"}, {"hd_01_03", "hd_00_03"}, Way::name, {{1, 0}}},
      {"from 0 and from 1: order, not number",
       {"cam0", "cam1", "cam2"},
       {"GOPRO_3", "GOPRO_1", "GOPRO_2"},
       Way::order,
       {{2, 0, 1}}},
      {"as many takes as cameras: the word before the number tells",
       {"1", "2"},
       {"cam1/take1", "cam1/take2", "cam2/take1", "cam2/take2"},
       Way::name,
       {{0, 0, 1, 1}}},
      {"the same in one folder",
       {"0", "1"},
       {"cam0_take0", "cam0_take1", "cam1_take0", "cam1_take1"},
       Way::name,
       {{0, 0, 1, 1}}},
      {"GoPro files", {"a", "b"}, {"GX020456", "GX010123"}, Way::order, {{1, 0}}},
      {"order in each folder", {"a", "b"}, {"run/x1", "run/x2", "walk/x7", "walk/x9"}, Way::order, {{0, 1, 0, 1}}},
      {"a folder of any name for each camera",
       {"a", "b"},
       {"p/run", "q/run", "p/walk", "q/walk"},
       Way::order,
       {{0, 0, 1, 1}}},
      {"a camera without file", {"cam1", "cam2", "cam3"}, {"cam3", "cam1"}, Way::name, {{2, 0}}},
      {"too few files for an order", {"a", "b", "c"}, {"x", "y"}, Way::none, {{std::nullopt, std::nullopt}}},
      {"one camera", {"anything"}, {"clip7", "clip9"}, Way::order, {{0, 0}}},
  };
  for (const Case& test : cases) {
    CameraMatch match = match_cameras(test.paths, test.cameras);
    EXPECT_EQ(match.way, test.way) << test.what << ": " << to_string(match.way);
    if (std::string(test.what) == "a folder of any name for each camera") {
      // p and q are folders with two files each, so either folder could be a sequence; the folders come first.
      EXPECT_EQ(match.num_matched(), 4);
      continue;
    }
    EXPECT_EQ(match.camera, test.expected) << test.what;
  }
}

TEST(CameraMatchReference, FilesThatDifferInTheCameraAreOneTake) {
  const CameraMatch match =
      match_cameras({"walk/cam1/cam1_a", "walk/cam2/cam2_a", "run/cam1/cam1_a", "run/cam2/cam2_a"}, {"cam1", "cam2"});
  EXPECT_EQ(match.sequence[0], match.sequence[1]) << "the camera stands in the folder and in the file";
  EXPECT_EQ(match.sequence[2], match.sequence[3]);
  EXPECT_NE(match.sequence[0], match.sequence[2]);
  EXPECT_EQ(match.largest_sequence(), 2);
  EXPECT_EQ(match.num_matched(), 4);
}

TEST(CameraMatchReference, AnyNamesAreTaken) {
  for (const Names& odd :
       {Names{}, Names{""}, Names{"", "/", "//a//"}, Names{std::string(5000, '7'), "\xff\xfe", "1_1_1_1"}})
    for (const Names& cameras : {Names{}, Names{""}, Names{"a", "a"}, Names{"1", "01"}}) {
      const CameraMatch match = match_cameras(odd, cameras);
      EXPECT_EQ(match.camera.size(), odd.size());
      EXPECT_EQ(match.sequence.size(), odd.size());
      for (const auto& camera : match.camera) EXPECT_LT(camera.value_or(-1), static_cast<int>(cameras.size()));
    }
}

TEST(CameraPatternReference, OnePatternWhereOneFits) {
  const Names cameras{"cam_01", "cam_02", "cam_10"};
  const auto pattern = [&](const std::map<int, std::string>& paths) { return paths_of_cameras(paths, cameras); };
  EXPECT_EQ(pattern({{0, "v/cam_01/{frame:04}.jpg"}, {1, "v/cam_02/{frame:04}.jpg"}}), "v/{name}/{frame:04}.jpg");
  EXPECT_EQ(pattern({{0, "v/000.mp4"}, {2, "v/002.mp4"}}), "v/{camera:03}.mp4");
  EXPECT_EQ(pattern({{0, "a0/x_0.mp4"}, {1, "a1/x_1.mp4"}}), "a{camera}/x_{camera}.mp4");
  EXPECT_EQ(pattern({{1, "clip.mp4"}}), "clip.mp4");
  const CameraPaths listed = pattern({{0, "v/cam01.mp4"}, {1, "v/cam02.mp4"}});
  EXPECT_EQ(listed.by_camera(),
            (std::map<std::string, std::string>{{"cam_01", "v/cam01.mp4"}, {"cam_02", "v/cam02.mp4"}}));
}

TEST(CameraMatchReference, CountersOfCamerasAreJoinedByTheirOrder) {
  const Names cameras{"cam1", "cam2"};
  const auto sequences = [&](const Names& paths) { return match_cameras(paths, cameras).sequence; };
  // 121 of the one is not 121 of the other, because both have filmed twice.
  const Names shifted = sequences({"cam1/GX010120", "cam1/GX010121", "cam2/GX010121", "cam2/GX010122"});
  EXPECT_EQ(shifted[0], shifted[2]);
  EXPECT_EQ(shifted[1], shifted[3]);
  EXPECT_NE(shifted[0], shifted[1]);
  const Names equal = sequences({"cam1/C0001", "cam1/C0002", "cam2/C0001", "cam2/C0002"});
  EXPECT_EQ(equal[0], equal[2]);
  // A person's numbers tell takes.
  const Names takes = sequences({"cam1/take1", "cam1/take2", "cam2/take2", "cam2/take3"});
  EXPECT_EQ(takes[1], takes[2]);
  EXPECT_NE(takes[0], takes[2]);
}

}  // namespace
}  // namespace doppel::camera_match_test
