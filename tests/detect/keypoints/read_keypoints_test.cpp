#include "doppel/detect/keypoints/read_keypoints.h"

#include <gmock/gmock.h>

#include <cmath>

#include "doppel/core/error.h"
#include "doppel/core/npy.h"
#include "doppel/detect/keypoints/keypoint_source.h"
#include "doppel/detect/keypoints/keypoint_table.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::read_keypoints_test {
namespace {

using support::message_of;
using support::replaced;
using ::testing::AllOf;
using ::testing::ElementsAre;
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
std::string alphapose(const std::string& image, int count, const std::string& confidence = "0.5") {
  return R"({"image_id":")" + image + R"(","category_id":1,"keypoints":[)" + flat(count, confidence) +
         R"(],"score":2.9,"box":[0,0,9,9],"idx":[0.0]})";
}
/// Three points at (0.5, 0), (10.5, 1), (20.5, 2).
std::string mmpose_person(const std::string& scores = "[0.5,0.5,0.5]") {
  return R"({"keypoints":[[0.5,0],[10.5,1],[20.5,2]],"keypoint_scores":)" + scores + R"(,"bbox":[[0,0,9,9]]})";
}
constexpr char kEasyMocapPerson[] =
    R"({"personID":0,"bbox":[0,0,9,9,1],"keypoints":[[0.5,0,0.5],[10.5,1,0.5],[20.5,2,0.5]],"isKeyframe":false})";
std::string easymocap(const std::string& people) {
  return R"({"filename":"images/0/000000.jpg","height":100,"width":100,"annots":[)" + people + "]}";
}

class KeypointFiles : public ::testing::Test {
 protected:
  People people(const std::string& text, int count = 3, const KeypointCamera& camera = {}) const {
    support::write_bytes(file_, text);
    return read_people(file_, layout_of(count), camera);
  }
  std::map<long, People> all(const std::string& text, int count = 3, const KeypointCamera& camera = {}) const {
    support::write_bytes(file_, text);
    return read_all_people(file_, layout_of(count), camera);
  }
  Detections detections(const std::string& text) const {
    support::write_bytes(file_, text);
    return read_detections(file_);
  }
  std::string format(const std::string& text) const { return detections(text).format; }
  std::map<long, People> table(const std::string& rows, const std::string& camera = "2") const {
    return all("frame,camera,name,x,y,confidence\n" + rows, 3, {camera});
  }
  static void expect_person(const Person& person, float confidence = 0.5f) {
    ASSERT_GE(person.size(), 3u);
    EXPECT_FLOAT_EQ(person[2].x, 20.5f);
    EXPECT_FLOAT_EQ(person[2].y, 2.0f);
    EXPECT_FLOAT_EQ(person[2].confidence, confidence);
  }
  void expect_survives(const std::string& valid, const KeypointCamera& camera = {}) const {
    const auto read = [&](const std::filesystem::path& path) {
      for (const DetectedImage& image : read_detections(path, camera).images)
        for (const DetectedPerson& person : image.people)
          for (const Keypoint& point : person.body) {
            EXPECT_TRUE(std::isfinite(point.x) && std::isfinite(point.y));
            EXPECT_TRUE(point.confidence >= 0.0f && point.confidence <= 1.0f) << point.confidence;
          }
    };
    support::expect_survives_hostile_files(file_, valid, read, 30);
  }

  support::TemporaryFolder folder_;
  std::filesystem::path file_ = folder_ / "k.any";  // the name says nothing
};

// ---- one image ----

TEST_F(KeypointFiles, OfOneImageInEveryForm) {
  for (const std::string& text :
       {openpose(openpose_person(3)), "[" + coco("7", 3) + "]", R"({"annotations":[)" + coco("7", 3, "1") + "]}",
        R"({"instances":[)" + mmpose_person() + "]}", R"({"predictions":[[)" + mmpose_person() + "]]}",
        "[[" + mmpose_person() + "]]", R"({"meta_info":{},"instance_info":[)" + mmpose_person() + "]}",
        std::string(R"([{"keypoints":[[0.5,0,1],[10.5,1,0.1],[20.5,2,0.5]]}])"), easymocap(kEasyMocapPerson),
        R"({"version":"AlphaPose v0.3","bodies":[{"joints":[)" + flat(3, "0.5") + "]}]}",
        "[" + alphapose("1.jpg", 3) + "]"}) {
    const People found = people(text);
    ASSERT_EQ(found.size(), 1u) << text;
    expect_person(found[0]);
  }
  EXPECT_EQ(people(openpose(openpose_person(3) + "," + openpose_person(3))).size(), 2u);
  EXPECT_TRUE(people("[]").empty());
}

TEST_F(KeypointFiles, AreRecognisedByTheirContent) {
  EXPECT_EQ(format(openpose("")), "openpose");
  EXPECT_EQ(format(easymocap("")), "easymocap");
  EXPECT_EQ(format("[" + alphapose("1.jpg", 3) + "]"), "alphapose");
  EXPECT_EQ(format(R"({"1.jpg":{"people":[]}})"), "alphapose");
  EXPECT_EQ(format("[" + coco("1", 3) + "]"), "coco");
  EXPECT_EQ(format("[" + mmpose_person() + "]"), "mmpose");
  EXPECT_EQ(format("\xEF\xBB\xBF\n " + openpose("")), "openpose");
  EXPECT_EQ(format("frame,x0,y0,x1,y1\n0,1,2,3,4\n"), "wide_csv");
}

TEST_F(KeypointFiles, WideTablesHaveTheColumnsOfOtherPrograms) {
  for (const char* word : {"conf", "p", "vis", "score", "probability"}) {
    const std::string table = fmt::format("frame,nose_x,nose_y,nose_{0},hip_x,hip_y,hip_{0}\n0,1,2,.5,0,0,0\n", word);
    const Detections found = detections(table);
    ASSERT_EQ(found.images.size(), 1u) << word;
    EXPECT_EQ(found.images[0].people[0].body[0].confidence, .5f) << word;
    EXPECT_EQ(found.images[0].people[0].body[1].confidence, 0.f) << word;
  }
  const Detections sleap = detections(
      "track,frame_idx,instance.score,nose.x,nose.y,nose.score,hip.x,hip.y,hip.score\n"
      "a,7,.9,1,2,.5,3,4,.5\nb,7,.9,5,6,.5,7,8,.5\na,8,.9,1,2,.5,3,4,.5\n");
  ASSERT_EQ(sleap.images.size(), 2u);
  EXPECT_EQ(sleap.images[0].frame, 7);
  ASSERT_EQ(sleap.images[0].people.size(), 2u);
  EXPECT_EQ(sleap.images[0].people[1].body[1].x, 7.f);
  const Detections named = detections("image,a_x,a_y,b_x,b_y\n000004.png,1,2,3,4\n");
  EXPECT_FALSE(named.images.at(0).frame);
  EXPECT_EQ(named.images.at(0).name, "000004.png");
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
  const Person hidden = people(R"({"annotations":[{"keypoints":[1,2,1,3,4,1,5,6,0],"image_id":1}]})")[0];
  EXPECT_EQ(hidden[0].confidence, 0.5f) << "annotations hold labels even if nothing is visible";
  EXPECT_EQ(people("[" + alphapose("1.jpg", 3, "5.5") + "]")[0][2].confidence, 1.0f);
}

TEST_F(KeypointFiles, OfNobodyInEveryForm) {
  const std::string nan = "NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN,NaN";
  for (const std::string person : {"", "{}", "null", R"({"pose_keypoints_2d":[]})", R"({"person_id":[-1]})",
                                   R"({"pose_keypoints_2d":[0,0,0,0,0,0,0,0,0]})"})
    EXPECT_TRUE(people(openpose(person)).empty()) << person;
  EXPECT_TRUE(people(openpose(R"({"pose_keypoints_2d":[)" + nan + "]}")).empty());
  EXPECT_TRUE(people(easymocap("")).empty());
  EXPECT_TRUE(people(R"({"annotations":[{"image_id":1,"keypoints":[0,0,0,0,0,0,0,0,0]}]})").empty());
  // One point is missing, and a name holds the word.
  const Person some =
      people(R"({"NaN \" NaN":1,"people":[{"pose_keypoints_2d":[1,2,0.5,NaN,-Infinity,0.5,20.5,2,0.5]}]})")[0];
  expect_person(some);
  EXPECT_EQ(some[1].confidence, 0.0f);
}

TEST_F(KeypointFiles, FaceAndHandsFollowTheBodyIfTheLayoutHasThem) {
  std::string person = replaced(openpose_person(3), "]}", R"(],"hand_left_keypoints_2d":[)" + flat(21, "0.25") + "]}");
  person = replaced(
      openpose(openpose_person(3)), openpose_person(3),
      R"({"pose_keypoints_2d":[)" + flat(3, "0.5") + R"(],"hand_left_keypoints_2d":[)" + flat(21, "0.25") + "]}");
  expect_person(people(person)[0]);
  const Person whole = people(person, 3 + 70 + 21 + 21)[0];
  EXPECT_EQ(whole[3].confidence, 0.0f) << "no face was found";
  EXPECT_EQ(whole[73 + 20].x, 200.5f);
  EXPECT_EQ(whole[94].confidence, 0.0f);
  const std::string feet =
      R"({"annotations":[{"image_id":1,"keypoints":[)" + flat(3, "2") + R"(],"foot_kpts":[)" + flat(6, "1") + R"(]}]})";
  EXPECT_EQ(people(feet, 9)[0][8].x, 50.5f);
  const std::string hand = replaced(kEasyMocapPerson, R"("isKeyframe")", R"("handl2d":[[7,8,0.5]],"isKeyframe")");
  EXPECT_EQ(people(easymocap(hand), 4)[0][3].x, 7.0f);
}

TEST_F(KeypointFiles, PartsOfTheImagesSizeBecomePixels) {
  const std::string text = openpose(R"({"pose_keypoints_2d":[0.5,0.25,1,0.1,0.9,1,0.3,0.4,1,1.1,-0.1,0.5]})");
  const Person person = people(text, 4, {"c", 0, 200, 100})[0];
  EXPECT_FLOAT_EQ(person[0].x, 100.0f);
  EXPECT_FLOAT_EQ(person[0].y, 25.0f);
  EXPECT_FLOAT_EQ(person[3].x, 220.0f);
  EXPECT_FLOAT_EQ(person[3].y, -10.0f);
  EXPECT_THAT(message_of<FileError>([&] { people(text, 4, {"left"}); }),
              AllOf(HasSubstr("k.any"), HasSubstr("parts of the image's size"), HasSubstr("left")));
  EXPECT_THAT(message_of<FileError>([&] {
                people(openpose(R"({"pose_keypoints_2d":[-0.5,-0.25,1,0.1,0.9,1,0.3,-0.4,1,0.1,0.1,1]})"), 4);
              }),
              HasSubstr("-1 to 1"));
}

// ---- all images ----

TEST_F(KeypointFiles, OfAllImagesByFrame) {
  const auto results = all("[" + coco("4", 3) + "," + coco("12", 3) + "," + coco("4", 3, "0.9") + "]");
  ASSERT_EQ(results.size(), 2u);
  EXPECT_EQ(results.at(4).size(), 2u);
  expect_person(results.at(12)[0]);
  const auto labelled =
      all(R"({"images":[{"id":99,"file_name":"a/000005.png"},{"id":7,"file_name":"a/000006.png"}],"annotations":[)" +
          coco("99", 3, "1") + "]}");
  ASSERT_EQ(labelled.size(), 2u);
  expect_person(labelled.at(5)[0]);
  EXPECT_TRUE(labelled.at(6).empty()) << "an image without people is there";
}

TEST_F(KeypointFiles, OfMmposeCountFromOneOrZero) {
  const std::string frames =
      R"({"frame_id":FIRST,"instances":[)" + mmpose_person() + R"(]},{"frame_id":SECOND,"instances":[]})";
  const auto from = [&](const std::string& first, const std::string& second) {
    return replaced(replaced(frames, "FIRST", first), "SECOND", second);
  };
  EXPECT_EQ(all("[" + from("0", "1") + "]").at(0).size(), 1u);
  EXPECT_EQ(all("[" + from("1", "2") + "]").at(1).size(), 1u) << "the inferencer counts from 0";
  EXPECT_EQ(all(R"({"instance_info":[)" + from("1", "2") + "]}").at(0).size(), 1u);
  EXPECT_TRUE(all(R"({"instance_info":[)" + from("1", "2") + "]}").at(1).empty());
  EXPECT_EQ(all(R"({"instance_info":[)" + from("0", "1") + "]}").at(0).size(), 1u);
}

TEST_F(KeypointFiles, OfAlphaPoseInEveryContainer) {
  const auto flat_list =
      all("[" + alphapose("9.jpg", 3) + "," + alphapose("10.jpg", 3) + "," + alphapose("10.jpg", 3, "0.9") + "]");
  ASSERT_EQ(flat_list.size(), 2u);
  EXPECT_EQ(flat_list.at(10).size(), 2u);
  const auto open = all(R"({"v_0003.jpg":{"version":0.1,"people":[{"pose_keypoints_2d":[)" + flat(3, "0.5") +
                        R"(]}]},"v_0004.jpg":{"version":0.1,"people":[]}})");
  expect_person(open.at(3)[0]);
  EXPECT_TRUE(open.at(4).empty());
  const auto cmu = all(R"({"v_0003.jpg":{"version":"AlphaPose v0.3","bodies":[{"joints":[)" + flat(3, "0.5") + "]}]}}");
  expect_person(cmu.at(3)[0]);
}

TEST_F(KeypointFiles, ImagesWithoutNumbersOfTheirOwnAreInNaturalOrder) {
  const auto found = all("[" + alphapose("shot 1 (10).png", 3, "0.1") + "," + alphapose("shot 1 (9)_.png", 3, "0.2") +
                         "," + alphapose("shot 1 (10)_.png", 3, "0.3") + "]");
  ASSERT_EQ(found.size(), 3u);
  EXPECT_FLOAT_EQ(found.at(0)[0][0].confidence, 0.2f);
  EXPECT_FLOAT_EQ(found.at(1)[0][0].confidence, 0.1f);
  EXPECT_FLOAT_EQ(found.at(2)[0][0].confidence, 0.3f);
}

// ---- tables ----

TEST_F(KeypointFiles, TablesOfOneCamera) {
  const auto found = table("3,2,p2,20.5,2,0.5\r\n3,1,p0,1,1,1\n4,2,p0,9,9,0\n");
  ASSERT_EQ(found.size(), 2u);
  expect_person(found.at(3)[0]);
  EXPECT_EQ(found.at(3)[0][0].confidence, 0.0f);
  EXPECT_TRUE(found.at(4).empty()) << "nobody was seen";
  const auto refusal = [&](const std::string& rows) { return message_of<FileError>([&] { table(rows); }); };
  EXPECT_THAT(refusal("3,2,nose,1,1,1\n"), AllOf(HasSubstr("k.any"), HasSubstr("nose"), HasSubstr("p0, p1, p2")));
  EXPECT_THAT(refusal("3,2,p0,1,1,1\n3,2,p0,1,1,1\n"), AllOf(HasSubstr("k.any:3"), HasSubstr("twice")));
  EXPECT_THAT(refusal("3,2,p0,1,1,1\n3,2,P0,1,1,1\n"), HasSubstr("two spellings"));
  EXPECT_THAT(refusal("3,2,p0,1,1,1.5\n"), HasSubstr("0 to 1"));
  EXPECT_THAT(refusal("3,7,p0,1,1,1\n"), AllOf(HasSubstr("camera '2'"), HasSubstr("7")));
}

TEST_F(KeypointFiles, TablesAreWrittenAndReadAgain) {
  const std::map<long, People> frames{{3, {{{1.5f, 2.0f, 0.5f}, {}, {20.5f, 2.0f, 0.75f}}}}, {5, {}}};
  write_keypoint_table(file_, layout_of(3), frames);
  EXPECT_TRUE(is_keypoint_table(file_));
  const auto read = read_all_people(file_, layout_of(3), {"left"});
  ASSERT_EQ(read.size(), 1u);
  EXPECT_EQ(read.at(3)[0][0].x, 1.5f);
  EXPECT_EQ(read.at(3)[0][1].confidence, 0.0f);
  EXPECT_EQ(read.at(3)[0][2].confidence, 0.75f);
  write_keypoint_table(file_, layout_of(3), {{5, {}}});
  EXPECT_TRUE(read_all_people(file_, layout_of(3), {"left"}).at(5).empty());
}

TEST_F(KeypointFiles, TablesKeepAnyNameOfAPoint) {
  const PointLayout odd{"odd", {"a,b", "say \"nose\"", " edge ", "7"}};
  write_keypoint_table(file_, odd, {{0, {{{1, 2, 0.5f}, {3, 4, 0.5f}, {5, 6, 0.5f}, {7, 8, 0.5f}}}}});
  const auto found = read_all_people(file_, odd);
  for (std::size_t k = 0; k < 4; ++k) EXPECT_EQ(found.at(0)[0][k].x, 1.0f + 2.0f * static_cast<float>(k)) << k;
}

TEST_F(KeypointFiles, TablesWithoutACameraAreOfOneCamera) {
  const std::string header = "frame,name,x,y,confidence\n";
  const auto found = all(header + "3,p2,20.5,2,0.5\n3,p0,1.5,2,0.25\n", 3, {"any"});
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found.at(3)[0][0].x, 1.5f);
  EXPECT_EQ(found.at(3)[0][2].confidence, 0.5f);
  const auto refusal = [&](const std::string& text) { return message_of<FileError>([&] { all(text, 3, {"any"}); }); };
  EXPECT_THAT(refusal(header), HasSubstr("no rows"));
  EXPECT_THAT(refusal(header + "3,cam,p0,1,1,1\n"), HasSubstr("k.any:2"));
}

TEST_F(KeypointFiles, TablesGoByTheNamesOfTheirColumns) {
  for (const std::string text :
       {"x,y,confidence,frame,joint\n20.5,2,0.5,3,p2\n1.5,2,1,3,p0\n", "frame,keypoint,x,y,score\n3,p2,20.5,2,0.5\n",
        "name,frame,x,y,likelihood\np2,3,20.5,2,0.5\n", "Frame_ID,Body Part,X,Y,C\n3,p2,20.5,2,0.5\n",
        ",frame,landmark,x,y,z,visibility\n0,3,p2,20.5,2,-7,0.5\n",
        "image,bodypart,x,y,conf\ncam_03.png,p2,20.5,2,0.5\n",
        "frame,joint_id,x,y,confidence\n3,0,1,1,0\n3,2,20.5,2,0.5\n",
        "sep=;\nframe;marker;x;y;conf\n3;p2;20,5;2;0,5\n"}) {
    const auto found = all(text, 3, {"any", 0, 100, 100});
    ASSERT_EQ(found.count(3), 1u) << text;
    ASSERT_EQ(found.at(3).size(), 1u) << text;
    expect_person(found.at(3)[0]);
  }
  const auto people = all("frame,person_id,joint,x,y\n3,7,p0,1,2\n3,9,p0,30,2\n3,9,p2,31,2\n").at(3);
  ASSERT_EQ(people.size(), 2u);
  EXPECT_EQ(people[1][2].x, 31.0f);
  EXPECT_EQ(people[1][2].confidence, 1.0f) << "no column says how sure it is";
  EXPECT_EQ(all("cam,y,x,frame,joint\nleft,2,1,3,p0\nright,5,6,3,p0\n", 3, {"right"}).at(3)[0][0].x, 6.0f);
}

TEST_F(KeypointFiles, TablesOfNumberedPointsCountFromZeroOrOne) {
  std::string from_one = "frame,landmark_id,x,y\n", from_zero = from_one;
  for (int k = 0; k < 17; ++k) {
    from_one += fmt::format("0,{},{},5\n", k + 1, 10 * k);
    from_zero += fmt::format("0,{},{},5\n", k, 10 * k);
  }
  for (const std::string& text : {from_one, from_zero}) {
    const Person person = all(text, 17).at(0)[0];
    EXPECT_EQ(person[0].x, 0.0f);
    EXPECT_EQ(person[16].x, 160.0f);
  }
}

TEST_F(KeypointFiles, TablesSayWhichColumnsAreMissing) {
  const auto refusal = [&](const std::string& text) { return message_of<FileError>([&] { all(text, 3, {"any"}); }); };
  EXPECT_THAT(refusal("x,y,confidence,joint\n1,2,0.5,p0\n"),
              AllOf(HasSubstr("the frame"), HasSubstr("x, y, confidence, joint")));
  EXPECT_THAT(refusal("x,y,frame\n1,2,3\n"), AllOf(HasSubstr("the point"), HasSubstr("joint, keypoint")));
  EXPECT_THAT(refusal("frame,joint,score\n1,p0,3\n"),
              AllOf(HasSubstr("frame, joint, score"), HasSubstr("`x` and `y`")));
  EXPECT_THAT(refusal("frame,joint,x,y,z\n1,p0,3,4,5\n"), HasSubstr("points in space"));
  EXPECT_THAT(refusal("frame,joint,x,y\n1,p0,3,4\n1,p0,5,6\n"), AllOf(HasSubstr("twice"), HasSubstr("`person`")));
  EXPECT_THAT(refusal("frame,joint,x,y\n1.5,p0,3,4\n"), AllOf(HasSubstr("k.any:2"), HasSubstr("1.5")));
  EXPECT_THAT(refusal("frame,joint,x,y\n1,p0,\"3,4\n"), AllOf(HasSubstr("k.any:2"), HasSubstr("quotation mark")));
  EXPECT_THAT(refusal("frame;joint;x;y\n1;p0;3\n"), AllOf(HasSubstr("3 columns"), HasSubstr("';'")));
}

TEST_F(KeypointFiles, TablesInEverySpellingOfSpreadsheets) {
  const PointLayout named{"named", {"RHip", "Nose"}};
  for (const std::string text :
       {"frame,nose_x,nose_y,right_hip_x,right_hip_y\n2,10.5,20,30,40\n",
        "\"frame\",\"nose_x\",\"nose_y\",\"right_hip_x\",\"right_hip_y\"\n\"2\",\"10.5\",\"20\",\"30\",\"40\"\n",
        "\"frame\",\"nose_x\",\"nose_y\",\"right_hip_x\",\"right_hip_y\"\n\"1\",2,10.5,20,30,40\n\"2\",3,NA,NA,1,1\n",
        "\"\",\"frame\",\"nose_x\",\"nose_y\",\"right_hip_x\",\"right_hip_y\"\n\"1\",2,10.5,20,30,40\n",
        "frame;nose_x;nose_y;right_hip_x;right_hip_y\r\n2;10,5;20;30;40\r\n3;;;NaN;null\r\n",
        "frame;nose_x;nose_y;right_hip_x;right_hip_y\n2;10.5;20;30;40\n",
        "frame\tnose_x\tnose_y\tright_hip_x\tright_hip_y\n2.0\t10,5\t2,0e1\t30\t40\n3\t1\t2\t\t\n",
        "frame,nose_x,nose_y,right_hip_x,right_hip_y\n2,\"10,5\",20,30,40\n",
        "frame,nose_x,nose_y,right_hip_x,right_hip_y\n2,10.5,20,30,40,\n"}) {
    support::write_bytes(file_, text);
    const auto found = read_all_people(file_, named);
    ASSERT_EQ(found.count(2), 1u) << text;
    EXPECT_EQ(found.at(2)[0][1].x, 10.5f) << text;
    EXPECT_EQ(found.at(2)[0][0].y, 40.0f) << text;
  }
  const std::string deeplabcut = "scorer;net;net;net\nbodyparts;nose;nose;nose\ncoords;x;y;likelihood\n2;10,5;20;0,5\n";
  support::write_bytes(file_, deeplabcut);
  EXPECT_EQ(read_all_people(file_, named).at(2)[0][1].x, 10.5f);
}

constexpr char kDeepLabCut[] =
    "scorer,net,net,net,net,net,net\n"
    "bodyparts,left ear,left ear,left ear,nose,nose,nose\n"
    "coords,x,y,likelihood,x,y,likelihood\n"
    "0,100.5,200,0.9,,,\n"
    "1,101.5,201,0.8,50,60,0.7\n";

TEST_F(KeypointFiles, OfDeepLabCutGoByNames) {
  const PointLayout layout{"animal", {"Nose", "tail", "LEar"}};
  support::write_bytes(file_, kDeepLabCut);
  const auto found = read_all_people(file_, layout);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_FLOAT_EQ(found.at(0)[0][2].x, 100.5f);
  EXPECT_FLOAT_EQ(found.at(0)[0][2].confidence, 0.9f);
  EXPECT_EQ(found.at(0)[0][0].confidence, 0.0f);
  EXPECT_EQ(found.at(1)[0][0].y, 60.0f);
  EXPECT_EQ(found.at(1)[0][1].confidence, 0.0f) << "the file has no tail";
  EXPECT_THAT(message_of<FileError>([&] { read_all_people(file_, layout_of(3)); }),
              AllOf(HasSubstr("left ear"), HasSubstr("p0, p1, p2")));
}

TEST_F(KeypointFiles, OfDeepLabCutHoldSeveralAnimalsAndLabels) {
  const PointLayout layout{"animal", {"nose", "tail"}};
  support::write_bytes(file_,
                       "scorer,,,me,me,me,me,me,me\n"
                       "individuals,,,a,a,a,a,b,b\n"
                       "bodyparts,,,nose,nose,tail,tail,nose,nose\n"
                       "coords,,,x,y,x,y,x,y\n"
                       "labeled-data,m1,img0007.png,1,2,3,4,105,106\n"
                       "labeled-data,m1,img0010.png,,,3,4,,\n");
  const auto found = read_all_people(file_, layout);
  ASSERT_EQ(found.size(), 2u);
  ASSERT_EQ(found.at(7).size(), 2u);
  EXPECT_EQ(found.at(7)[1][0].x, 105.0f);
  EXPECT_EQ(found.at(7)[1][0].confidence, 1.0f) << "a label has no likelihood";
  EXPECT_EQ(found.at(7)[1][1].confidence, 0.0f);
  ASSERT_EQ(found.at(10).size(), 1u);
  EXPECT_EQ(found.at(10)[0][1].y, 4.0f);
}

TEST_F(KeypointFiles, OfMediaPipeHaveOneRowPerFrame) {
  const std::string rows =
      "frame,L1_x,L1_y,L1_z,L1_visibility,L0_x,L0_y,L0_z,L0_visibility\n5,0.25,0.5,-1,0.75,0.5,0.5,0,1\n"
      "6,0.25,0.5,-1,0.75,,,,\n";
  const auto found = all(rows, 2, {"c", 0, 400, 200});
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found.at(5)[0][1].x, 100.0f);
  EXPECT_EQ(found.at(5)[0][1].y, 100.0f);
  EXPECT_EQ(found.at(5)[0][1].confidence, 0.75f);
  EXPECT_EQ(found.at(5)[0][0].x, 200.0f);
  EXPECT_EQ(found.at(6)[0][0].confidence, 0.0f);
  EXPECT_THROW(all(rows, 2), FileError) << "the size of the images is not known";
  EXPECT_EQ(all("x1,y1,x2,y2\n10,20,30,40\n11,21,31,41\n", 2).at(1)[0][1].y, 41.0f) << "pixels, counted from 1";
  EXPECT_EQ(all("p1.x,p1.y,p0.x,p0.y\n10,20,30,40\n", 2).at(0)[0][1].y, 20.0f);
  const PointLayout named{"named", {"RHip", "Nose"}};
  support::write_bytes(file_, "frame_id,nose_x,nose_y,right_hip_x,right_hip_y\n0,10,20,30,40\n");
  EXPECT_EQ(read_all_people(file_, named).at(0)[0][0].y, 40.0f);
}

TEST_F(KeypointFiles, OfFreeMoCapHoldAllCameras) {
  // [cameras, frames, points, 2]: the number is its own position, and one point is missing.
  std::vector<double> numbers(2 * 3 * 40 * 2);
  for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i] = static_cast<double>(i);
  numbers[(1 * 3 + 2) * 80 + 2] = std::nan("");
  write_npy(file_, numbers.data(), {2, 3, 40, 2});
  const auto found = read_all_people(file_, layout_of(33), {"right", 1});
  ASSERT_EQ(found.size(), 3u);
  EXPECT_EQ(found.at(2)[0][0].x, 400.0f);
  EXPECT_EQ(found.at(2)[0][0].confidence, 1.0f);
  EXPECT_EQ(found.at(2)[0][1].confidence, 0.0f);
  EXPECT_EQ(found.at(2)[0][32].y, 465.0f);
  EXPECT_EQ(read_all_people(file_, layout_of(40), {"right", 1}).at(0)[0][39].y, 319.0f) << "hands and face";
  EXPECT_THAT(message_of<FileError>([&] { read_all_people(file_, layout_of(33), {"third", 2}); }), HasSubstr("0 to 1"));
  EXPECT_THROW(read_all_people(file_, layout_of(33), {"no index"}), FileError);
  write_npy(file_, numbers.data(), {2, 3, 80});
  EXPECT_THROW(read_all_people(file_, layout_of(33), {"right", 1}), FileError);
}

// ---- layouts ----

TEST_F(KeypointFiles, NamesInAFileDecideTheOrder) {
  const std::string text = R"({"meta_info":{"keypoint_id2name":{"0":"left_hip","1":"nose","2":"right_hip"}},)"
                           R"("instance_info":[)" +
                           mmpose_person() + "]}";
  support::write_bytes(file_, text);
  const Person moved = read_people(file_, {"mine", {"Nose", "LHip", "RHip"}})[0];
  EXPECT_FLOAT_EQ(moved[0].x, 10.5f);
  EXPECT_FLOAT_EQ(moved[1].x, 0.5f);
  EXPECT_FLOAT_EQ(moved[2].x, 20.5f);
  expect_person(read_people(file_, layout_of(3))[0]);
  EXPECT_THAT(message_of<FileError>([&] {
                read_people(file_, {"mine", {"Nose", "LHip", "tail"}});
              }),
              AllOf(HasSubstr("left_hip, nose"), HasSubstr("tail"), HasSubstr("keypoint_map")));
}

TEST_F(KeypointFiles, OtherLayoutsAndFormsAreRefused) {
  EXPECT_THAT(
      message_of<FileError>([&] { people(openpose(openpose_person(18)), 25); }),
      AllOf(HasSubstr("18 points"), HasSubstr("25 of 'p25'"), HasSubstr("coco18 has 18"), HasSubstr("keypoint_map")));
  EXPECT_THAT(message_of<FileError>([&] { people(openpose(openpose_person(25)), 18); }),
              HasSubstr("body25 or body25b has 25"));
  for (const std::string& text :
       {std::string("3"), std::string("{}"), std::string("words"), std::string(R"({"people":3})"), openpose("3"),
        openpose(R"({"pose_keypoints_2d":[1,2]})"), openpose(R"({"pose_keypoints_2d":[1,2,"x",1,2,3,1,2,3]})"),
        openpose(R"({"pose_keypoints_2d":[1e200,2,1,1,2,3,1,2,3]})"),
        openpose(R"({"pose_keypoints_2d":[],"face_keypoints_2d":[1,2,1]})"), std::string(R"({"people":[)"),
        R"({"instances":[)" + mmpose_person("[1,1]") + "]}",
        R"({"instances":[{"keypoints":[[1],[2],[3]]}]})" + std::string(), std::string(R"({"people":[[[[[[[]]]]]]]})"),
        std::string(R"({"instances":[[[[[[[]]]]]]]})"), std::string(R"({"annotations":{}})"),
        std::string(R"({"annots":3})"), std::string(R"({"bodies":3})")})
    EXPECT_THROW(people(text), FileError) << text;
  EXPECT_THAT(message_of<FileError>([&] { people("{\n\"people\":\n[x"); }), HasSubstr("k.any:3"));
  EXPECT_THAT(message_of<FileError>([&] { all("[" + mmpose_person() + "]"); }), HasSubstr("{frame}"));
  EXPECT_THROW(all(R"([{"image_id":-3,"keypoints":[]}])"), FileError);
  EXPECT_THAT(
      message_of<FileError>([&] { people(R"([{"keypoints":[[1,2,3],[1,2,3],[1,2,3]],"keypoint_scores":[1,1,1]}])"); }),
      HasSubstr("3D lifter"));
}

TEST_F(KeypointFiles, SurviveHostileFiles) {
  expect_survives(openpose(openpose_person(4, "0.7")));
  expect_survives("[" + coco("3", 3) + "," + coco("4", 3) + "]");
  expect_survives(R"({"images":[{"id":1,"file_name":"1.jpg"}],"annotations":[)" + coco("1", 3, "1") +
                  R"(],"categories":[{"keypoints":["a","b","c"]}]})");
  expect_survives("[" + alphapose("1.jpg", 3) + "," + alphapose("2.jpg", 3) + "]");
  expect_survives(R"({"1.jpg":{"people":[{"pose_keypoints_2d":[)" + flat(3, "0.5") + "]}]}}");
  expect_survives(R"([{"frame_id":0,"instances":[)" + mmpose_person() + R"(]},{"frame_id":1,"instances":[]}])");
  expect_survives(easymocap(kEasyMocapPerson));
  expect_survives("frame,camera,name,x,y,confidence\n0,c,p0,1.5,2.5,0.5\n0,c,p1,1.5,2.5,0.5\n", {"c"});
  expect_survives("x;y;score;frame;person;joint\n1,5;2,5;0,5;0;1;\"nose\"\n1,5;2,5;0,5;0;2;\"nose\"\n");
  expect_survives("image,landmark_id,x,y\na_1.png,0,1,2\na_2.png,1,3,4\n");
  expect_survives(kDeepLabCut);
  expect_survives("frame,L0_x,L0_y,L1_x,L1_y\n0,10,20,30,40\n1,10,20,30,40\n");
}

TEST_F(KeypointFiles, DeepNestingIsRefused) {
  for (const char open : {'[', '{'}) {
    std::string text;
    for (int i = 0; i < 100000; ++i) text += open == '[' ? "[" : "{\"people\":";
    EXPECT_THROW(people(text), FileError);
    text += open == '[' ? "" : "1";
    for (int i = 0; i < 100000; ++i) text += open == '[' ? ']' : '}';
    EXPECT_THROW(people(text), FileError);
  }
}

TEST_F(KeypointFiles, TooManyValuesForTheMemoryAreRefusedBeforeTheyAreParsed) {
  std::string text = "[";
  for (int i = 0; i < 30'000'000; ++i) text += "{},";
  EXPECT_THAT(message_of<FileError>([&] { people(text + "{}]"); }), HasSubstr("takes up to 4.3 GB of memory"));
}

// ---- sources ----

TEST_F(KeypointFiles, SourcesOfAPatternAndOfOneFile) {
  support::write_bytes(folder_ / "f_0003.json", openpose(openpose_person(3)));
  const KeypointSource single((folder_ / "f_{frame:04}.json").string(), layout_of(3), {"c"}, 0);
  EXPECT_EQ(single.people(3)->size(), 1u);
  EXPECT_FALSE(single.people(4).has_value());
  support::write_bytes(file_, "[" + coco("3", 3) + "]");
  const KeypointSource whole(file_.string(), layout_of(3), {"c"}, 0);
  EXPECT_EQ(whole.people(3)->size(), 1u);
  EXPECT_TRUE(whole.people(4)->empty());
  EXPECT_THROW(KeypointSource((folder_ / "none.json").string(), layout_of(3), {"c"}, 0), FileError);
}

TEST_F(KeypointFiles, SourcesOfAFolder) {
  const std::filesystem::path folder = folder_ / "cam01_json";
  std::filesystem::create_directory(folder);
  EXPECT_THAT(message_of<FileError>([&] { KeypointSource(folder.string(), layout_of(3), {"c"}, 0); }),
              HasSubstr("no .json file"));
  support::write_bytes(folder / "cam01.0031.json", openpose(openpose_person(3)));
  EXPECT_EQ(KeypointSource(folder.string(), layout_of(3), {"c"}, 0).people(31)->size(), 1u) << "one file of one image";
  support::write_bytes(folder / "cam01.9.json", openpose(openpose_person(3) + "," + openpose_person(3)));
  support::write_bytes(folder / "readme.txt", "not read");
  const KeypointSource source(folder.string(), layout_of(3), {"c"}, 0);
  EXPECT_EQ(source.people(31)->size(), 1u);
  EXPECT_EQ(source.people(9)->size(), 2u);
  EXPECT_FALSE(source.people(10).has_value());
  EXPECT_EQ(source.range(), std::pair(9L, 31L));
  const KeypointSource shifted(folder.string(), layout_of(3), {"c"}, 1);
  EXPECT_EQ(shifted.people(8)->size(), 2u) << "the number in the file is that of the frame plus the offset";
  EXPECT_EQ(shifted.range(), std::pair(8L, 30L));
  EXPECT_FALSE(shifted.people(-5).has_value());
  const std::filesystem::path results = folder_ / "results";
  std::filesystem::create_directory(results);
  support::write_bytes(results / "alphapose-results.json", "[" + alphapose("7.jpg", 3) + "]");
  EXPECT_EQ(KeypointSource(results.string(), layout_of(3), {"c"}, 0).people(7)->size(), 1u) << "one file of all frames";
}

}  // namespace
}  // namespace doppel::read_keypoints_test
