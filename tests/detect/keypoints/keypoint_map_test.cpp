#include "doppel/detect/keypoints/keypoint_map.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <map>

#include "doppel/core/error.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::keypoint_map_test {
namespace {

using support::message_of;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::vector<Marker> landmarks(const std::vector<std::string>& names) {
  std::vector<Marker> result;
  for (const std::string& name : names) result.push_back({name, 0, Eigen::Vector3d::Zero()});
  return result;
}

/// Point i lies at (i, 2 i) with confidence 0.5 + i / 100.
Person numbered(int count) {
  Person person;
  for (int i = 0; i < count; ++i)
    person.push_back({static_cast<float>(i), 2.0f * static_cast<float>(i), 0.5f + 0.01f * static_cast<float>(i)});
  return person;
}

const std::map<std::string, std::size_t> kNumberOfPoints{
    {"body25", 25},      {"body25b", 25},       {"coco17", 17},        {"coco18", 18},
    {"halpe26", 26},     {"halpe136", 136},     {"wholebody133", 133}, {"mediapipe33", 33},
    {"mediapipe75", 75}, {"mediapipe543", 543}, {"h36m17", 17},        {"mhr70", 70}};

TEST(KeypointMaps, BuiltInOnesHaveTheirNumbersOfPoints) {
  EXPECT_THAT(builtin_keypoint_maps(),
              ElementsAre("body25", "body25b", "coco17", "coco18", "halpe26", "halpe136", "wholebody133", "mediapipe33",
                          "mediapipe75", "mediapipe543", "h36m17", "mhr70"));
  for (const auto& [name, count] : kNumberOfPoints) {
    const KeypointMap map = read_keypoint_map(name);
    EXPECT_EQ(map.layout.name, name);
    EXPECT_EQ(map.layout.points.size(), count) << name;
  }
  EXPECT_EQ(builtin_layouts().size(), kNumberOfPoints.size());
  EXPECT_EQ(builtin_layouts()[5].name, "halpe136");
}

TEST(KeypointMaps, BuiltInOnesKnowTheLandmarksOfBody25InAnySpelling) {
  const PointLayout body25 = read_keypoint_map("body25").layout;
  for (const std::string& name : builtin_keypoint_maps()) {
    const KeypointMap map = read_keypoint_map(name);
    for (const std::string& landmark : body25.points) EXPECT_NE(map.find(landmark), nullptr) << name << " " << landmark;
    for (const std::string spelling : {"RWrist", "right_wrist", "Right Wrist", "R_WRIST", "rightWrist", "wrist.R"})
      EXPECT_EQ(map.find(spelling), map.find("RWrist")) << name << " " << spelling;
  }
}

/// The positions of some landmarks, as the makers of the layouts document them.
TEST(KeypointMaps, BuiltInOnesPutLandmarksInTheirPositions) {
  const auto indices = [](const char* map, const char* landmark) {
    return read_keypoint_map(map).find(landmark)->points;
  };
  const std::map<std::string, int> right_wrist{{"body25", 4},        {"body25b", 10},     {"coco17", 10},
                                               {"coco18", 4},        {"halpe26", 10},     {"halpe136", 10},
                                               {"wholebody133", 10}, {"mediapipe33", 16}, {"mediapipe75", 16},
                                               {"mediapipe543", 16}, {"h36m17", 16},      {"mhr70", 41}};
  for (const auto& [map, index] : right_wrist) EXPECT_THAT(indices(map.c_str(), "RWrist"), ElementsAre(index)) << map;
  const std::map<std::string, int> left_ankle{{"body25", 14},       {"body25b", 15},     {"coco17", 15},
                                              {"coco18", 13},       {"halpe26", 15},     {"halpe136", 15},
                                              {"wholebody133", 15}, {"mediapipe33", 27}, {"mediapipe75", 27},
                                              {"mediapipe543", 27}, {"h36m17", 6},       {"mhr70", 13}};
  for (const auto& [map, index] : left_ankle) EXPECT_THAT(indices(map.c_str(), "LAnkle"), ElementsAre(index)) << map;
  EXPECT_THAT(indices("halpe26", "MidHip"), ElementsAre(19));
  EXPECT_THAT(indices("h36m17", "MidHip"), ElementsAre(0));
  EXPECT_THAT(indices("mediapipe33", "MidHip"), ElementsAre(23, 24));
  EXPECT_THAT(indices("halpe26", "RBigToe"), ElementsAre(21));
  EXPECT_THAT(indices("wholebody133", "RBigToe"), ElementsAre(20));
  EXPECT_THAT(indices("mediapipe33", "RBigToe"), ElementsAre(32));
  EXPECT_THAT(indices("mhr70", "LHeel"), ElementsAre(17));
  EXPECT_THAT(indices("mhr70", "right_thumb1"), ElementsAre(24)) << "the third joint from the tip";
  EXPECT_THAT(indices("wholebody133", "right_thumb4"), ElementsAre(116));
  EXPECT_THAT(indices("mediapipe75", "right_thumb4"), ElementsAre(58));
  EXPECT_THAT(indices("mediapipe543", "right_thumb4"), ElementsAre(526));
  EXPECT_THAT(indices("mediapipe543", "face_mesh_4"), ElementsAre(37));
  EXPECT_THAT(indices("coco17", "RHeel"), ElementsAre());
  EXPECT_THAT(indices("body25b", "HeadTop"), ElementsAre(18));
}

TEST(KeypointMaps, EveryPointOfALayoutIsUsed) {
  for (const std::string& name : builtin_keypoint_maps()) {
    const KeypointMap map = read_keypoint_map(name);
    std::vector<bool> used(map.layout.points.size(), false);
    for (const auto& entry : map.entries)
      for (const int point : entry.points) used.at(point) = true;
    EXPECT_EQ(std::count(used.begin(), used.end(), false), 0) << name;
  }
}

TEST(KeypointMaps, PickLandmarksAndTheirMiddles) {
  const KeypointMap map = read_keypoint_map("coco17");
  const LandmarkPicker picker(map, landmarks({"right_wrist", "neck", "LHeel"}));
  Person person = numbered(17);
  std::vector<Keypoint> picked = picker.pick(person);
  ASSERT_EQ(picked.size(), 3u);
  EXPECT_FLOAT_EQ(picked[0].x, 10.0f);
  EXPECT_FLOAT_EQ(picked[1].y, 11.0f);  // of the shoulders, 5 and 6
  EXPECT_FLOAT_EQ(picked[1].confidence, 0.55f);
  EXPECT_EQ(picked[2].confidence, 0.0f);
  person[5] = {};
  picked = picker.pick(person);
  EXPECT_EQ(picked[1].confidence, 0.0f);
  EXPECT_EQ(picked[1].x, 0.0f);
  EXPECT_EQ(picker.pick(std::nullopt).size(), 3u);
}

TEST(KeypointMaps, UnknownLandmarksListTheKnownOnes) {
  EXPECT_THAT(message_of<Error>([] { LandmarkPicker(read_keypoint_map("body25"), landmarks({"tail"})); }),
              AllOf(HasSubstr("tail"), HasSubstr("RSmallToe"), HasSubstr("absent")));
  EXPECT_THAT(message_of<UsageError>([] { read_keypoint_map("body26"); }),
              AllOf(HasSubstr("body26"), HasSubstr("coco17")));
}

TEST(KeypointMaps, KnowMarkersByName) {
  Skeleton skeleton;
  skeleton.markers = landmarks({"nose", "tail", "left_big_toe"});
  const std::vector<Marker> known = known_markers(skeleton, read_keypoint_map("body25"));
  ASSERT_EQ(known.size(), 2u);
  EXPECT_EQ(known[1].name, "left_big_toe");
  const KeypointMap names = map_of_names(skeleton.markers);
  EXPECT_THAT(names.layout.points, ElementsAre("nose", "tail", "left_big_toe"));
  EXPECT_THAT(names.find("tail")->points, ElementsAre(1));
}

class KeypointMapFile : public ::testing::Test {
 protected:
  KeypointMap read(const std::string& text) const {
    support::write_bytes(file_, text);
    return read_keypoint_map(file_.string());
  }
  std::string refusal(const std::string& text) const {
    return message_of<FileError>([&] { read(text); });
  }
  support::TemporaryFolder folder_;
  std::filesystem::path file_ = folder_ / "map.yaml";
};

TEST_F(KeypointMapFile, OfAnotherDetector) {
  const KeypointMap map =
      read("points: [head, hand]\nlandmarks:\n  nose: head\n  middle: [head, hand]\nabsent: [toe]\n");
  EXPECT_EQ(map.layout.points.size(), 2u);
  EXPECT_THAT(map.find("middle")->points, ElementsAre(0, 1));
  EXPECT_TRUE(map.find("toe")->points.empty());
  EXPECT_EQ(map.find("head"), nullptr);
}

TEST_F(KeypointMapFile, MayMakeEveryPointALandmark) {
  const KeypointMap map = read("points: [head, hand_l, hip_l]\nevery_point: true\nlandmarks: {LHip: hand_l}\n");
  EXPECT_THAT(map.find("head")->points, ElementsAre(0));
  EXPECT_THAT(map.find("left_hand")->points, ElementsAre(1));
  EXPECT_THAT(map.find("left_hip")->points, ElementsAre(1)) << "a line under landmarks comes first";
  EXPECT_EQ(map.entries.size(), 3u);
}

TEST_F(KeypointMapFile, MayNameARangeOfPoints) {
  const KeypointMap map = read("points: [head, 'face_{0..2}', 'a{9..10}b', '{x}']\nlandmarks: {nose: face_1}\n");
  EXPECT_THAT(map.layout.points, ElementsAre("head", "face_0", "face_1", "face_2", "a9b", "a10b", "{x}"));
  EXPECT_THAT(map.find("nose")->points, ElementsAre(2));
  EXPECT_THAT(refusal("points: ['a{2..1}']\nlandmarks: {nose: a1}\n"),
              AllOf(HasSubstr("map.yaml:1"), HasSubstr("'a{2..1}' must ascend")));
  EXPECT_THAT(refusal("points: ['a{0..10000}']\nlandmarks: {nose: a1}\n"), HasSubstr("to at most 9999"));
  EXPECT_THAT(refusal("points: ['a{0..9999}', 'b{0..9999}']\nlandmarks: {nose: a1}\n"),
              HasSubstr("are more than 10000"));
  EXPECT_THAT(refusal("points: ['a{0..1}', a1]\nlandmarks: {nose: a1}\n"), HasSubstr("once"));
}

TEST_F(KeypointMapFile, MessagesListSomeOfManyPoints) {
  EXPECT_THAT(refusal("points: ['a{0..467}']\nlandmarks: {nose: b}\n"),
              AllOf(HasSubstr("a0, a1,"), HasSubstr("a149 and 318 more")));
}

TEST_F(KeypointMapFile, OfOlderVersionsNamesEachLandmarkTwice) {
  const KeypointMap map =
      read("layout: body25\nlandmarks:\n  Nose: Nose\n  nose: Nose\n  right_wrist: RWrist\n  RWrist: RWrist\n");
  EXPECT_EQ(map.layout.name, "body25");
  EXPECT_EQ(map.entries.size(), 4u);
  EXPECT_THAT(map.find("RWrist")->points, ElementsAre(4));
}

TEST_F(KeypointMapFile, RefusedWithTheLine) {
  EXPECT_THAT(refusal("layout: coco17\nlandmarks:\n  nose: Snout\n"),
              AllOf(HasSubstr("map.yaml:3"), HasSubstr("Snout"), HasSubstr("left_eye")));
  EXPECT_THAT(refusal("layout: body26\nlandmarks: {nose: Nose}\n"), HasSubstr("body25"));
  EXPECT_THAT(refusal("landmarks: {nose: Nose}\n"), HasSubstr("points"));
  EXPECT_THAT(refusal("points: [a, a]\nlandmarks: {nose: a}\n"), HasSubstr("once"));
  EXPECT_THAT(refusal("points: [a]\n"), HasSubstr("landmarks"));
  EXPECT_THAT(refusal("points: [a]\nlandmarks: {nose: a}\nabsent: [nose]\n"), HasSubstr("twice"));
  EXPECT_THAT(refusal("points: [a]\nlandmarks: {nose: []}\n"), HasSubstr("absent"));
  EXPECT_THAT(refusal("points: [a]\nlandmarks: {nose: a}\nlandmark: {}\n"), HasSubstr("landmark"));
}

TEST_F(KeypointMapFile, SurvivesHostileFiles) {
  support::expect_survives_hostile_files(
      file_, "layout: coco17\nlandmarks:\n  nose: nose\n  neck: [left_shoulder, right_shoulder]\nabsent: [toe]\n",
      [](const std::filesystem::path& path) { read_keypoint_map(path.string()); }, 30);
}

}  // namespace
}  // namespace doppel::keypoint_map_test
