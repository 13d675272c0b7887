#include "doppel/capture/keypoints.h"

#include <gmock/gmock.h>

#include <opencv2/imgproc.hpp>

#include "doppel/core/error.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::keypoints_test {
namespace {

using support::message_of;
using ::testing::AllOf;
using ::testing::HasSubstr;

PointLayout layout_of(int count) {
  PointLayout layout{"p" + std::to_string(count), {}};
  for (int i = 0; i < count; ++i) layout.points.push_back("p" + std::to_string(i));
  return layout;
}

/// "x,y,c" of `count` points, the i-th at (10 i + 0.5, i).
std::string flat(int count, const std::string& confidence) {
  std::string text;
  for (int i = 0; i < count; ++i)
    text += (i ? "," : "") + std::to_string(10 * i) + ".5," + std::to_string(i) + "," + confidence;
  return text;
}

std::string openpose(const std::string& people) { return R"({"version":1.3,"people":[)" + people + "]}"; }
std::string openpose_person(int count, const std::string& confidence = "0.5") {
  return R"({"person_id":[-1],"pose_keypoints_2d":[)" + flat(count, confidence) + "]}";
}
std::string coco(const std::string& image, int count, const std::string& confidence = "0.5") {
  return R"({"image_id":)" + image + R"(,"category_id":1,"keypoints":[)" + flat(count, confidence) +
         R"(],"score":0.9})";
}
/// Three points at (0.5, 0), (10.5, 1), (20.5, 2).
std::string mmpose_person(const std::string& scores = "[0.5,0.5,0.5]") {
  return R"({"keypoints":[[0.5,0],[10.5,1],[20.5,2]],"keypoint_scores":)" + scores + R"(,"bbox":[[0,0,9,9]]})";
}

class KeypointFiles : public ::testing::Test {
 protected:
  People people(const std::string& text, int count = 3) const {
    support::write_bytes(file_, text);
    return read_people(file_, layout_of(count));
  }
  std::map<long, People> all(const std::string& text, int count = 3) const {
    support::write_bytes(file_, text);
    return read_all_people(file_, layout_of(count));
  }
  std::map<long, People> table(const std::string& rows, const std::string& camera = "2") const {
    support::write_bytes(folder_ / "k.csv", "frame,camera,name,x,y,confidence\n" + rows);
    return read_keypoint_table(folder_ / "k.csv", layout_of(3), camera);
  }
  static void expect_person(const Person& person, float confidence = 0.5f) {
    ASSERT_GE(person.size(), 3u);
    EXPECT_FLOAT_EQ(person[2].x, 20.5f);
    EXPECT_FLOAT_EQ(person[2].y, 2.0f);
    EXPECT_FLOAT_EQ(person[2].confidence, confidence);
  }

  support::TemporaryFolder folder_;
  std::filesystem::path file_ = folder_ / "k.json";
};

TEST_F(KeypointFiles, OfOneImageInEveryForm) {
  for (const std::string& text :
       {openpose(openpose_person(3)), "[" + coco("7", 3) + "]", R"({"annotations":[)" + coco("7", 3) + "]}",
        R"({"instances":[)" + mmpose_person() + "]}", R"({"predictions":[[)" + mmpose_person() + "]]}",
        "[[" + mmpose_person() + "]]", R"({"meta_info":{},"instance_info":[)" + mmpose_person() + "]}",
        std::string(R"([{"keypoints":[[0.5,0,1],[10.5,1,0.1],[20.5,2,0.5]]}])")}) {
    const People found = people(text);
    ASSERT_EQ(found.size(), 1u) << text;
    expect_person(found[0]);
  }
  EXPECT_EQ(people(openpose(openpose_person(3) + "," + openpose_person(3))).size(), 2u);
  EXPECT_TRUE(people(openpose("")).empty());
  EXPECT_TRUE(people("[]").empty());
}

TEST_F(KeypointFiles, ConfidencesAreHeldToTheirRange) {
  const Person person = people(R"({"instances":[)" + mmpose_person("[1.3,-0.2,0.5]") + "]}")[0];
  EXPECT_EQ(person[0].confidence, 1.0f);
  EXPECT_EQ(person[1].confidence, 0.0f);
  EXPECT_EQ(person[1].x, 0.0f);
  // COCO's labels: not labelled, hidden, visible.
  const Person labelled = people(R"([{"keypoints":[1,2,2,3,4,1,5,6,0]}])")[0];
  EXPECT_EQ(labelled[0].confidence, 1.0f);
  EXPECT_EQ(labelled[1].confidence, 0.5f);
  EXPECT_EQ(labelled[2].confidence, 0.0f);
}

TEST_F(KeypointFiles, OfAllImagesByFrame) {
  const auto results = all("[" + coco("4", 3) + "," + coco("\"cam3_000012.jpg\"", 3) + "," + coco("4", 3, "0.9") + "]");
  ASSERT_EQ(results.size(), 2u);
  EXPECT_EQ(results.at(4).size(), 2u);
  expect_person(results.at(12)[0]);
  const auto labelled =
      all(R"({"images":[{"id":99,"file_name":"a/000005.png"}],"annotations":[)" + coco("99", 3) + "]}");
  EXPECT_EQ(labelled.begin()->first, 5);
  const std::string frames =
      R"({"frame_id":FIRST,"instances":[)" + mmpose_person() + R"(]},{"frame_id":SECOND,"instances":[]})";
  const auto from = [&](const std::string& first, const std::string& second) {
    return support::replaced(support::replaced(frames, "FIRST", first), "SECOND", second);
  };
  EXPECT_EQ(all("[" + from("0", "1") + "]").at(0).size(), 1u);
  EXPECT_EQ(all(R"({"instance_info":[)" + from("1", "2") + "]}").at(0).size(), 1u);
  EXPECT_TRUE(all(R"({"instance_info":[)" + from("1", "2") + "]}").at(1).empty());
  EXPECT_EQ(all(R"({"instance_info":[)" + from("0", "1") + "]}").at(0).size(), 1u);
}

TEST_F(KeypointFiles, TablesOfOneCamera) {
  const auto found = table("3,2,p2,20.5,2,0.5\r\n3,1,p0,1,1,1\n4,2,p0,9,9,0\n");
  ASSERT_EQ(found.size(), 2u);
  expect_person(found.at(3)[0]);
  EXPECT_EQ(found.at(3)[0][0].confidence, 0.0f);
  const auto refusal = [&](const std::string& rows) { return message_of<FileError>([&] { table(rows); }); };
  EXPECT_THAT(refusal("3,2,nose,1,1,1\n"), AllOf(HasSubstr("k.csv:2"), HasSubstr("nose"), HasSubstr("p0, p1, p2")));
  EXPECT_THAT(refusal("3,2,p0,1,1,1\n3,2,p0,1,1,1\n"), HasSubstr("twice"));
  EXPECT_THAT(refusal("3,2,p0,1,1,1.5\n"), HasSubstr("0 to 1"));
  EXPECT_THAT(refusal("3,7,p0,1,1,1\n"), AllOf(HasSubstr("camera '2'"), HasSubstr("7")));
}

TEST_F(KeypointFiles, OtherLayoutsAndFormsAreRefused) {
  EXPECT_THAT(message_of<FileError>([&] { people(openpose(openpose_person(18)), 25); }),
              AllOf(HasSubstr("18 points"), HasSubstr("25 of 'p25'"), HasSubstr("keypoint_map")));
  for (const std::string& text :
       {std::string("3"), std::string("{}"), std::string(R"({"people":3})"), openpose("3"), openpose("{}"),
        openpose(R"({"pose_keypoints_2d":[1,2]})"), openpose(R"({"pose_keypoints_2d":[1,2,"x",1,2,3,1,2,3]})"),
        std::string(R"({"people":[)"), R"({"instances":[)" + mmpose_person("[1,1]") + "]}",
        R"({"instances":[{"keypoints":[[1],[2],[3]]}]})" + std::string(), std::string(R"({"people":[[[[[[[]]]]]]]})")})
    EXPECT_THROW(people(text), FileError) << text;
  EXPECT_THAT(message_of<FileError>([&] { all("[" + mmpose_person() + "]"); }), HasSubstr("{frame}"));
  EXPECT_THROW(all(R"([{"image_id":-3,"keypoints":[]}])"), FileError);
  EXPECT_THROW(all(R"([{"image_id":"none.jpg","keypoints":[]}])"), FileError);
}

TEST_F(KeypointFiles, SurviveHostileFiles) {
  support::expect_survives_hostile_files(
      file_, openpose(openpose_person(4, "0.7")),
      [](const std::filesystem::path& path) { read_people(path, layout_of(4)); }, 30);
  support::expect_survives_hostile_files(
      file_, "[" + coco("3", 3) + "," + coco("4", 3) + "]",
      [](const std::filesystem::path& path) { read_all_people(path, layout_of(3)); }, 30);
  support::expect_survives_hostile_files(
      folder_ / "k.csv", "frame,camera,name,x,y,confidence\n0,c,p0,1.5,2.5,0.5\n0,c,p1,1.5,2.5,0.5\n",
      [](const std::filesystem::path& path) {
        for (const auto& [frame, people] : read_keypoint_table(path, layout_of(3), "c"))
          for (const Keypoint& point : people.at(0)) EXPECT_TRUE(std::isfinite(point.x) && std::isfinite(point.y));
      },
      30);
}

TEST_F(KeypointFiles, SourcesOfBothKinds) {
  support::write_bytes(folder_ / "f_0003.json", openpose(openpose_person(3)));
  const KeypointSource single((folder_ / "f_{frame:04}.json").string(), layout_of(3), "c");
  EXPECT_EQ(single.people(3)->size(), 1u);
  EXPECT_FALSE(single.people(4).has_value());
  support::write_bytes(file_, "[" + coco("3", 3) + "]");
  const KeypointSource whole(file_.string(), layout_of(3), "c");
  EXPECT_EQ(whole.people(3)->size(), 1u);
  EXPECT_TRUE(whole.people(4)->empty());
  EXPECT_THROW(KeypointSource((folder_ / "none.json").string(), layout_of(3), "c"), FileError);
}

TEST(ChosenPerson, IsTheSurestOrTheOneOnTheMask) {
  const Person left{{10, 10, 0.5f}, {12, 30, 0.5f}}, right{{80, 10, 0.9f}, {82, 30, 0.9f}};
  EXPECT_FALSE(choose_person({}).has_value());
  EXPECT_EQ((*choose_person({left}))[0].x, 10);
  EXPECT_EQ((*choose_person({left, right}))[0].x, 80);
  cv::Mat mask = cv::Mat::zeros(50, 100, CV_8U);
  EXPECT_EQ((*choose_person({left, right}, mask))[0].x, 80) << "an empty mask says nothing";
  cv::rectangle(mask, cv::Rect(5, 5, 20, 40), 255, cv::FILLED);
  EXPECT_EQ((*choose_person({left, right}, mask))[0].x, 10);
  const Person outside{{-5, 500, 1.0f}};
  EXPECT_EQ((*choose_person({outside, left}, mask))[0].x, 10);
  cv::Mat other = cv::Mat::zeros(50, 100, CV_8U);
  cv::rectangle(other, cv::Rect(45, 20, 4, 4), 255, cv::FILLED);
  EXPECT_EQ((*choose_person({left, right}, other))[0].x, 80) << "nobody is on this mask";
}

}  // namespace
}  // namespace doppel::keypoints_test
