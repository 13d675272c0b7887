#include "doppel/detect/keypoints/guess_layout.h"

#include <gmock/gmock.h>

#include "detect/keypoints/standing_person.h"
#include "doppel/core/error.h"
#include "doppel/detect/keypoints/keypoint_map.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::guess_layout_test {
namespace {

using support::message_of;
using ::testing::AllOf;
using ::testing::HasSubstr;

const FileLocation kWhere{"people.json", 0};

/// A person who stands in front of the camera, in pixels; parts that are on no standing_body are not seen.
Detections standing(const std::string& layout, int people = 3) {
  Detections detections;
  detections.images.emplace_back();
  for (int i = 0; i < people; ++i) {
    DetectedPerson person;
    for (const auto& point : test_keypoints::standing_body(read_keypoint_map(layout).layout))
      person.body.push_back(point ? Keypoint{static_cast<float>(200 * point->x() + 300 + 150 * i),
                                             static_cast<float>(500 - 200 * point->y()), 0.9f}
                                  : Keypoint());
    detections.images.back().people.push_back(person);
  }
  return detections;
}

TEST(GuessedLayout, OfEveryBuiltInLayout) {
  for (const PointLayout& layout : builtin_layouts())
    EXPECT_EQ(guess_layout({standing(layout.name)}, kWhere), layout.name);
}

TEST(GuessedLayout, IsFoundByTheNamesOfTheFile) {
  Detections named;
  named.points = {"right_ankle", "nose", "l_hip"};
  named.by_name = true;
  EXPECT_EQ(guess_layout({named}, kWhere), "body25") << "the first that has all of them";
  named.points.push_back("left_foot_index");
  EXPECT_EQ(guess_layout({named}, kWhere), "mediapipe33");
  Detections annotated = standing("h36m17");
  annotated.points = read_keypoint_map("coco17").layout.points;
  EXPECT_EQ(guess_layout({annotated}, kWhere), "coco17");
}

TEST(GuessedLayout, CountsThePointsBesideTheBody) {
  Detections whole = standing("coco17", 1);
  whole.images[0].people[0].rest.resize(116);
  EXPECT_EQ(guess_layout({whole}, kWhere), "wholebody133");
  Detections hands = standing("body25", 1);
  hands.images[0].people[0].rest.resize(112);
  EXPECT_EQ(guess_layout({hands}, kWhere), "body25");
}

TEST(GuessedLayout, IsAskedForWhenThePeopleDoNotDecide) {
  EXPECT_EQ(guess_layout({Detections()}, kWhere), std::nullopt);
  Detections few = standing("body25", 1);
  for (std::size_t i = 3; i < 25; ++i) few.images[0].people[0].body[i] = {};
  EXPECT_THAT(message_of<FileError>([&] { guess_layout({few}, kWhere); }),
              AllOf(HasSubstr("people.json"), HasSubstr("body25 or body25b"), HasSubstr("keypoint_map")));
  Detections other;
  other.images.push_back({0, "", {{Person(16, {1, 1, 1}), {}}}});
  EXPECT_THAT(message_of<FileError>([&] { guess_layout({other}, kWhere); }),
              AllOf(HasSubstr("16 points"), HasSubstr("mhr70"), HasSubstr("keypoint_map")));
}

TEST(GuessedLayout, OfPatternsFoldersAndFiles) {
  const support::TemporaryFolder folder;
  std::string numbers;
  const Detections detections = standing("body25b");
  for (const Keypoint& point : detections.images[0].people[0].body)
    numbers += fmt::format("{}{},{},{}", numbers.empty() ? "" : ",", point.x, point.y, point.confidence);
  const std::string text = R"({"people":[{"pose_keypoints_2d":[)" + numbers + "]}]}";
  for (const char* name : {"0005.json", "0006.json"}) support::write_bytes(folder / name, text);
  EXPECT_EQ(guess_layout((folder / "{frame:04}.json").string(), {}), "body25b");
  EXPECT_EQ(guess_layout(folder.path().string(), {}), "body25b");
  EXPECT_EQ(guess_layout((folder / "0005.json").string(), {}), "body25b");
  EXPECT_EQ(guess_layout((folder / "none_{frame}.json").string(), {}), std::nullopt);
  EXPECT_THROW(guess_layout((folder / "none.json").string(), {}), FileError);
  // The first files of a long recording may show nobody.
  for (int frame = 5000; frame < 5100; ++frame)
    support::write_bytes(folder / fmt::format("late_{}.json", frame), frame < 5060 ? R"({"people":[]})" : text);
  EXPECT_EQ(guess_layout((folder / "late_{frame}.json").string(), {}), "body25b");
}

}  // namespace
}  // namespace doppel::guess_layout_test
