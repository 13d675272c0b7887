#include <gmock/gmock.h>

#include <algorithm>

#include "doppel/detect/keypoints/frame_names.h"
#include "doppel/detect/keypoints/keypoint_map.h"
#include "doppel/detect/keypoints/landmark_key.h"

namespace doppel::names_test {
namespace {

using ::testing::ElementsAre;

TEST(LandmarkKey, IsTheSameForAllSpellings) {
  for (const char* name : {"RShoulder", "right_shoulder", "Right Shoulder", "R_SHOULDER", "rightShoulder", "r-shoulder",
                           "shoulder_r", "ShoulderRight", "SHOULDER.R", "rShoulder", "RIGHT_SHOULDER", "rightshoulder"})
    EXPECT_EQ(landmark_key(name), "right_shoulder") << name;
  for (const char* name : {"LBigToe", "left_big_toe", "Left BigToe", "L_BIG_TOE", "leftBigToe", "LHallux"})
    EXPECT_EQ(landmark_key(name), "left_bigtoe") << name;
  for (const char* name : {"MidHip", "mid_hip", "pelvis", "Root", "hip", "Hip", "hips"})
    EXPECT_EQ(landmark_key(name), "midhip") << name;
  for (const char* name : {"HeadTop", "head_top", "Head", "top_head"}) EXPECT_EQ(landmark_key(name), "headtop") << name;
  EXPECT_EQ(landmark_key("mouth_left"), landmark_key("LMouth"));
  EXPECT_EQ(landmark_key("REar"), "right_ear");
  EXPECT_EQ(landmark_key("leftear"), "left_ear");
}

TEST(LandmarkKey, KeepsDifferentPartsApart) {
  EXPECT_NE(landmark_key("RHip"), landmark_key("LHip"));
  EXPECT_EQ(landmark_key("RHip"), "right_hip");
  EXPECT_NE(landmark_key("thorax"), landmark_key("neck"));
  EXPECT_NE(landmark_key("left_thumb1"), landmark_key("left_thumb2"));
  EXPECT_NE(landmark_key("face-1"), landmark_key("face-11"));
  EXPECT_EQ(landmark_key("rear"), "rear");
  EXPECT_EQ(landmark_key("left"), "left");
  EXPECT_EQ(landmark_key(""), "");
  EXPECT_EQ(landmark_key("--"), "--");
  EXPECT_EQ(landmark_key("L"), "l");
}

TEST(LandmarkKey, IsUniqueInEveryBuiltInLayout) {
  for (const PointLayout& layout : builtin_layouts()) {
    std::vector<std::string> keys;
    for (const std::string& point : layout.points) keys.push_back(landmark_key(point));
    std::sort(keys.begin(), keys.end());
    EXPECT_EQ(std::unique(keys.begin(), keys.end()), keys.end()) << layout.name;
  }
}

TEST(LandmarkKey, NamesAsWrittenComeFirst) {
  const std::vector<std::string> names{"right_hip", "RHip", "hand"};
  EXPECT_EQ(find_landmark(names, "RHip"), 1);
  EXPECT_EQ(find_landmark(names, "hip_r"), 0);
  EXPECT_EQ(find_landmark(names, "foot"), std::nullopt);
}

TEST(LandmarkKey, FindsTheOtherSide) {
  EXPECT_THAT(mirrored_indices({"nose", "LEye", "right_ear", "REye", "left_hand", "left_ear"}),
              ElementsAre(0, 3, 5, 1, 4, 2));
  for (const PointLayout& layout : builtin_layouts()) {
    const std::vector<int> mirrored = mirrored_indices(layout.points);
    for (std::size_t i = 0; i < mirrored.size(); ++i) {
      EXPECT_EQ(mirrored.at(static_cast<std::size_t>(mirrored[i])), static_cast<int>(i)) << layout.name;
      const std::string key = landmark_key(layout.points[i]);
      const bool has_side = key.starts_with("left_") || key.starts_with("right_");
      EXPECT_EQ(mirrored[i] != static_cast<int>(i), has_side) << layout.name << " " << layout.points[i];
    }
  }
}

TEST(FrameNames, AreTheLastNumber) {
  EXPECT_EQ(number_in_name("cam01.0031.json"), 31);
  EXPECT_EQ(number_in_name("video_000000000012_keypoints.json"), 12);
  EXPECT_EQ(number_in_name("a/b/7.jpg"), 7);
  EXPECT_EQ(number_in_name("cam3"), 3);
  EXPECT_EQ(number_in_name("name.json"), std::nullopt);
  EXPECT_EQ(number_in_name("1234567890123456.json"), std::nullopt);
  EXPECT_EQ(number_in_name(""), std::nullopt);
}

TEST(FrameNames, HaveANaturalOrder) {
  std::vector<std::string> names{"f10", "f9", "f09a", "g1", "f", "f9b", "f010"};
  std::sort(names.begin(), names.end(), natural_less);
  EXPECT_THAT(names, ElementsAre("f", "f9", "f09a", "f9b", "f010", "f10", "g1"));
  for (const std::string& a : names)
    for (const std::string& b : names) EXPECT_FALSE(natural_less(a, b) && natural_less(b, a)) << a << " " << b;
}

TEST(FrameNames, CountByPositionWhenNumbersRepeat) {
  const NumberedNames numbered = number_names({"a_12.png", "a_3.png"});
  EXPECT_THAT(numbered.frames, ElementsAre(12, 3));
  EXPECT_FALSE(numbered.by_position);
  const NumberedNames repeated = number_names({"shot 12 b.png", "shot 12 a.png", "shot 2.png"});
  EXPECT_THAT(repeated.frames, ElementsAre(2, 1, 0));
  EXPECT_TRUE(repeated.by_position);
  EXPECT_THAT(number_names({"b", "a"}).frames, ElementsAre(1, 0));
  EXPECT_TRUE(number_names({}).frames.empty());
}

TEST(FrameNames, OfTimesAreInTheirOrder) {
  const auto frames = [](const std::vector<std::string>& names) { return number_names(names).frames; };
  EXPECT_THAT(
      frames({"2024-05-06T07_08_10.030000.png", "2024-05-06T07_08_09.975000.png", "2024-05-06T07_08_09.920000.png"}),
      ElementsAre(2, 1, 0));
  EXPECT_THAT(frames({"2024-05-06T07_08_09.700.png", "2024-05-06T07_08_09.740.png"}), ElementsAre(0, 1))
      << "one second";
  EXPECT_THAT(frames({"20240506_070809_700.png", "20240506_070809_740.png"}), ElementsAre(0, 1));
  EXPECT_THAT(frames({"1714979289123.jpg", "1714979289083.jpg"}), ElementsAre(1, 0)) << "milliseconds since 1970";
  EXPECT_THAT(frames({"1714979289.8.jpg", "1714979289.755.jpg", "1714979290.jpg"}), ElementsAre(1, 0, 2));
  EXPECT_THAT(frames({"2024-05-06T07_08_10.04.png", "2024-05-06T07_08_10.png", "2024-05-06T07_08_09.96.png"}),
              ElementsAre(2, 1, 0));
  EXPECT_THAT(frames({"1714979289.8.jpg", "1714979289.755.jpg", "1714979290.1.jpg"}), ElementsAre(1, 0, 2));
  EXPECT_THAT(frames({"7_000_0.033.jpg", "8_000_0.066.jpg", "9_000_0.099.jpg"}), ElementsAre(0, 1, 2));
}

TEST(FrameNames, OfFramesKeepTheirNumbers) {
  const auto frames = [](const std::vector<std::string>& names) { return number_names(names).frames; };
  EXPECT_THAT(frames({"20240506_070809_000012.png", "20240506_070809_000013.png"}), ElementsAre(12, 13));
  EXPECT_THAT(frames({"20240506_070809_000010.png", "20240506_070809_000020.png"}), ElementsAre(10, 20));
  EXPECT_THAT(frames({"part1_0098.png", "part1_0099.png", "part2_0100.png"}), ElementsAre(98, 99, 100));
  EXPECT_THAT(frames({"img_000040.png", "img_000080.png"}), ElementsAre(40, 80)) << "some frames of a video";
  EXPECT_THAT(frames({"2024-05-06T07_08_09.png"}), ElementsAre(9));
}

}  // namespace
}  // namespace doppel::names_test
