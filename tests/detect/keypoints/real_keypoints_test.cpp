#include <gmock/gmock.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "doppel/calibration/formats/read_calibration.h"
#include "doppel/core/error.h"
#include "doppel/detect/keypoints/guess_layout.h"
#include "doppel/detect/keypoints/keypoint_map.h"
#include "doppel/detect/keypoints/keypoint_source.h"
#include "doppel/detect/keypoints/landmark_key.h"
#include "doppel/detect/keypoints/person_choice.h"
#include "doppel/detect/keypoints/read_keypoints.h"
#include "doppel/detect/keypoints/read_space_points.h"
#include "support/message_of.h"
#include "support/shared_folder.h"

namespace doppel::real_keypoints_test {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using ::testing::HasSubstr;

/// Compares the files of other programs with what a separate program read in them.
class RealKeypoints : public support::SharedFolderTest {
 protected:
  fs::path sample(const std::string& name) const { return shared_ / "formats" / "keypoints" / name; }
  Json ground_truth(const std::string& name, const std::string& file = "truth.json") const {
    std::ifstream stream(sample(name) / file);
    return Json::parse(stream);
  }
  static PointLayout layout(const std::string& name) { return read_keypoint_map(name).layout; }

  /// @param scale the image's size for fractions; @param third what the third number is worth
  static void expect_person(const Person& person, const Json& expected, double third = 1.0, double width = 1.0,
                            double height = 1.0) {
    ASSERT_EQ(person.size(), expected["points"].get<std::size_t>());
    int positive = 0;
    for (const Keypoint& point : person) positive += point.confidence > 0.0f;
    if (expected.contains("points_with_positive_confidence")) {
      EXPECT_EQ(positive, expected["points_with_positive_confidence"].get<int>());
    }
    ASSERT_FALSE(expected["selected"].empty());
    for (const auto& [name, numbers] : expected["selected"].items()) {
      const Keypoint& point = person.at(std::stoul(name));
      const double confidence = std::clamp(third * numbers.back().get<double>(), 0.0, 1.0);
      EXPECT_NEAR(point.confidence, confidence, 1e-6) << name;
      EXPECT_NEAR(point.x, confidence > 0 ? width * numbers[0].get<double>() : 0, 1e-4 * width) << name;
      EXPECT_NEAR(point.y, confidence > 0 ? height * numbers[1].get<double>() : 0, 1e-4 * height) << name;
    }
  }
  static void expect_point(const Keypoint& point, const Json& numbers) {
    EXPECT_NEAR(point.x, numbers[0].get<double>(), 1e-3);
    EXPECT_NEAR(point.y, numbers[1].get<double>(), 1e-3);
    EXPECT_NEAR(point.confidence, numbers[2].get<double>(), 1e-6);
  }
  /// All people of a file in its order.
  static std::vector<Person> everybody(const fs::path& path, const PointLayout& points) {
    std::vector<Person> all;
    for (const DetectedImage& image : read_detections(path).images)
      for (const DetectedPerson& person : image.people) {
        all.push_back(person.body);
        if (all.back().size() != points.points.size())
          all.back().insert(all.back().end(), person.rest.begin(), person.rest.end());
      }
    return all;
  }
  /// Ground truth that lists the images or people of one file in its order. @return how many people were compared
  static std::size_t expect_in_order(const std::vector<Person>& people, const Json& expected, double third) {
    std::size_t i = 0;
    for (const Json& frame : expected["frames"])
      for (const Json& person : frame["persons"]) {
        if (i >= people.size()) return 0;
        expect_person(people[i++], person, third);
      }
    return i;
  }
};

TEST_F(RealKeypoints, OfOpenPose12) {
  const Json expected = ground_truth("openpose_body25")["frames"][0];
  const fs::path file = sample("openpose_body25") / expected["file"].get<std::string>();
  const People people = read_people(file, layout("body25"));
  ASSERT_EQ(people.size(), 1u);
  expect_person(people[0], expected["persons"][0]);
  EXPECT_EQ(guess_layout(file.string(), {}), "body25");
}

TEST_F(RealKeypoints, OfOpenPoseWithFaceAndHands) {
  PointLayout whole = layout("body25");
  for (int i = 0; i < 112; ++i) whole.points.push_back("more" + std::to_string(i));
  const Json expected = ground_truth("openpose_body25_face_hands");
  const KeypointSource source(sample("openpose_body25_face_hands").string() + "/video_{frame:012}_keypoints.json",
                              whole, {}, 0);
  ASSERT_EQ(expected["frames"].size(), 3u);
  for (long f = 0; f < 3; ++f) {
    const Json person = expected["frames"][static_cast<std::size_t>(f)]["persons"][0];
    const People people = source.people(f).value();
    ASSERT_EQ(people.size(), 1u);
    expect_person(Person(people[0].begin(), people[0].begin() + 25), person);
    std::size_t at = 25;
    for (const char* part : {"face", "hand_left", "hand_right"}) {
      expect_point(people[0][at], person[part]["first"]);
      at += person[part]["points"].get<std::size_t>();
      expect_point(people[0][at - 1], person[part]["last"]);
    }
    EXPECT_EQ(at, people[0].size());
  }
}

TEST_F(RealKeypoints, OfOpenPoseFromFourCameras) {
  const Json expected = ground_truth("openpose_body25b_4cams");
  ASSERT_EQ(expected["frames"].size(), 24u);
  for (const Json& frame : expected["frames"]) {
    const fs::path file = sample("openpose_body25b_4cams") / frame["file"].get<std::string>();
    const KeypointSource source(file.parent_path().string(), layout("body25b"), {}, 0);
    const People people = source.people(frame["frame"].get<long>()).value();
    ASSERT_EQ(people.size(), frame["persons"].size()) << file;
    for (std::size_t i = 0; i < people.size(); ++i) expect_person(people[i], frame["persons"][i]);
    EXPECT_EQ(guess_layout(file.parent_path().string(), {}), "body25b");
  }
}

TEST_F(RealKeypoints, OfOpenPoseWithNobody) {
  int files = 0;
  for (const auto& entry : fs::recursive_directory_iterator(sample("openpose_empty"))) {
    if (!entry.is_regular_file() || entry.path().filename() == "truth.json") continue;
    EXPECT_TRUE(read_people(entry.path(), layout("body25")).empty()) << entry.path();
    EXPECT_TRUE(KeypointSource(entry.path().parent_path().string(), layout("body25"), {}, 0)
                    .people(52)
                    .value_or(People())
                    .empty());
    ++files;
  }
  EXPECT_EQ(files, 6);
}

TEST_F(RealKeypoints, OfAlphaPose) {
  for (const auto& [name, map] : {std::pair{"alphapose_coco17", "coco17"}, std::pair{"alphapose_halpe26", "halpe26"}}) {
    const Json expected = ground_truth(name);
    const fs::path file = sample(name) / "alphapose-results.json";
    const Detections found = read_detections(file);
    EXPECT_EQ(found.format, "alphapose");
    EXPECT_EQ(guess_layout(file.string(), {}), map);
    std::map<std::string, std::vector<Person>> people;
    for (const DetectedImage& image : found.images) people[image.name].push_back(image.people[0].body);
    ASSERT_EQ(people.size(), expected["frames"].size());
    for (const Json& image : expected["frames"]) {
      const auto& persons = people.at(image["image_id"].get<std::string>());
      ASSERT_EQ(persons.size(), image["persons"].size());
      for (std::size_t i = 0; i < persons.size(); ++i) expect_person(persons[i], image["persons"][i]);
    }
    const auto frames = read_all_people(file, layout(map));
    EXPECT_EQ(frames.size(), people.size());
    if (std::string(map) == "halpe26") expect_person(frames.at(11)[0], expected["frames"][11]["persons"][0]);
  }
}

TEST_F(RealKeypoints, OfCocoResults) {
  const fs::path file = sample("coco_results") / "person_keypoints_val2014_fakekeypoints100_results.json";
  const Json expected = ground_truth("coco_results");
  EXPECT_EQ(expect_in_order(everybody(file, layout("coco17")), expected, 0.5), expected["frames"].size());
  const auto frames = read_all_people(file, layout("coco17"));
  EXPECT_EQ(frames.at(136).size(), 2u);
  EXPECT_EQ(read_detections(file).format, "coco");
}

TEST_F(RealKeypoints, OfCocoAnnotations) {
  const std::tuple<const char*, const char*, const char*> files[] = {
      {"coco_wholebody_annotations", "test_coco_wholebody.json", "wholebody133"},
      {"halpe136_annotations", "test_halpe.json", "halpe136"}};
  for (const auto& [name, file, map] : files) {
    const Json expected = ground_truth(name);
    const std::vector<Person> people = everybody(sample(name) / file, layout(map));
    EXPECT_EQ(expect_in_order(people, expected, 0.5), expected["frames"].size()) << name;
    const auto frames = read_all_people(sample(name) / file, layout(map));
    for (const Json& image : expected["frames"])
      EXPECT_GT(frames.count(std::stol(image["image"].get<std::string>())), 0u);
    expect_person(frames.at(785)[0], expected["frames"][0]["persons"][0], 0.5);
  }
  EXPECT_EQ(read_all_people(sample("coco_wholebody_annotations") / "test_coco_wholebody.json", layout("coco17"))
                .at(785)[0]
                .size(),
            17u)
      << "the body alone";
}

TEST_F(RealKeypoints, OfMmposeVideosAndDemoScripts) {
  const fs::path file = sample("mmpose_inferencer_wholebody133") / "SOUP.json";
  const Json expected = ground_truth("mmpose_inferencer_wholebody133");
  const auto video = read_all_people(file, layout("wholebody133"));
  ASSERT_EQ(video.size(), expected["frames"].size());
  for (const Json& frame : expected["frames"]) {
    const People& people = video.at(frame["frame_id"].get<long>());
    ASSERT_EQ(people.size(), frame["persons"].size());
    for (std::size_t i = 0; i < people.size(); ++i) expect_person(people[i], frame["persons"][i]);
  }
  EXPECT_EQ(guess_layout(file.string(), {}), "wholebody133");
  const fs::path script = sample("mmpose_demo_instance_info") / "results_made.json";
  const auto demo = read_all_people(script, layout("wholebody133"));
  ASSERT_EQ(demo.size(), 2u);
  for (const long frame : {0L, 1L})
    for (std::size_t i = 0; i < 133; ++i) {
      EXPECT_EQ(demo.at(frame)[0][i].x, video.at(frame)[0][i].x);
      EXPECT_EQ(demo.at(frame)[0][i].confidence, video.at(frame)[0][i].confidence);
    }
  EXPECT_EQ(guess_layout(script.string(), {}), "wholebody133");
}

TEST_F(RealKeypoints, OfALifterArePointsInSpace) {
  const fs::path file = sample("mmpose_inferencer_image") / "img_002.json";
  EXPECT_THAT(support::message_of<FileError>([&] { read_people(file, layout("h36m17")); }), HasSubstr("3D lifter"));
  const SpacePoints points = read_space_points(file);
  const Json expected = ground_truth("mmpose_inferencer_image")["frames"][0]["persons"][0];
  ASSERT_EQ(points.names.size(), expected["points"].get<std::size_t>());
  for (const auto& [name, numbers] : expected["selected"].items())
    for (int i = 0; i < 3; ++i)
      EXPECT_NEAR((*points.frames.at(0)[std::stoul(name)])[i], numbers[static_cast<std::size_t>(i)].get<double>(),
                  1e-12);
}

TEST_F(RealKeypoints, OfDeepLabCut) {
  const Json expected = ground_truth("deeplabcut_collected");
  const PointLayout mouse{"mouse", expected["bodyparts"].get<std::vector<std::string>>()};
  const auto frames = read_all_people(sample("deeplabcut_collected") / "CollectedData_Pranav.csv", mouse);
  EXPECT_EQ(frames.size(), expected["frames"].get<std::size_t>());
  for (std::size_t i = 0; i < mouse.points.size(); ++i) {
    const Json& numbers = expected["first"][mouse.points[i]];
    expect_point(frames.at(0)[0][i], {numbers[0], numbers[1], 1.0});
  }
}

TEST_F(RealKeypoints, OfMediaPipe) {
  const fs::path file = sample("mediapipe_csv_wide") / "pose_landmarks.csv";
  const auto frames = read_all_people(file, layout("mediapipe33"), {"c", 0, 1920, 1080});
  EXPECT_EQ(frames.size(), 12u);
  const Json expected = ground_truth("mediapipe_csv_wide");
  for (const Json& frame : expected["frames"])
    expect_person(frames.at(frame["frame"].get<long>())[0], frame["persons"][0], 1.0, 1920, 1080);
  EXPECT_EQ(read_detections(file).unit, PointUnit::fractions);
  EXPECT_EQ(guess_layout(file.string(), {}), "mediapipe33");
}

TEST_F(RealKeypoints, InSpaceOfTrcAndCaliscope) {
  const Json trc = ground_truth("openpose_body25b_4cams", "truth_trc.json");
  const SpacePoints points =
      read_space_points(sample("openpose_body25b_4cams") / "pose-3d" / "S00_P00_T01_BalancingTrial_0-100.trc");
  EXPECT_EQ(points.unit, trc["unit_in_file"].get<std::string>());
  EXPECT_EQ(points.names, trc["markers"].get<std::vector<std::string>>());
  EXPECT_EQ(points.frames.size(), trc["rows"].get<std::size_t>());
  for (const auto& [key, numbers] : trc["selected_m"].items()) {
    const auto row = std::next(points.frames.begin(), std::stol(key.substr(4)));
    const auto name = std::find(points.names.begin(), points.names.end(), key.substr(key.rfind(' ') + 1));
    const auto& point = row->second.at(static_cast<std::size_t>(name - points.names.begin()));
    for (int i = 0; i < 3; ++i) EXPECT_NEAR((*point)[i], numbers[static_cast<std::size_t>(i)].get<double>(), 1e-12);
  }
  const Json expected = ground_truth("caliscope_xyz_holistic");
  const SpacePoints xyz = read_space_points(sample("caliscope_xyz_holistic") / "xyz_SIMPLE_HOLISTIC.csv");
  EXPECT_EQ(xyz.unit, expected["unit"].get<std::string>());
  ASSERT_EQ(xyz.names.size(), expected["point_ids"].size());
  for (const Json& frame : expected["frames"]) {
    const auto& found = xyz.frames.at(frame["sync_index"].get<long>());
    const Json& person = frame["persons"][0];
    EXPECT_EQ(std::count_if(found.begin(), found.end(), [](const auto& p) { return p.has_value(); }),
              person["points"].get<long>());
    for (const auto& [id, numbers] : person["selected"].items())
      for (int i = 0; i < 3; ++i)
        EXPECT_NEAR((*found[std::stoul(id)])[i], numbers[static_cast<std::size_t>(i)].get<double>(), 1e-12);
  }
}

// ---- one man among several people, four cameras ----

/// The man of the capture p2s, as another program triangulated him.
class RealPersonChoice : public support::SharedFolderTest {
 protected:
  void SetUp() override {
    SharedFolderTest::SetUp();
    if (IsSkipped()) return;
    const fs::path folder = shared_ / "captures" / "p2s";
    cameras_ = read_calibration(folder / "calibration.toml", {"m", "+y"});  // the file's own axes
    layout_ = read_keypoint_map("body25b").layout;
    reference_ = read_space_points(folder / "reference" / "pose2sim_filtered.trc");
    std::vector<KeypointSource> sources;
    for (const char* camera : {"cam01", "cam02", "cam03", "cam04"})
      sources.emplace_back((folder / "openpose" / camera).string(), layout_, KeypointCamera(), 0);
    for (long f = 0; f < 100; ++f) {
      frames_.emplace_back();
      for (const KeypointSource& source : sources) frames_.back().push_back(source.people(f).value_or(People()));
    }
  }

  /// The middle distance of a detection from the man's points, pixels.
  double distance(long frame, std::size_t camera, const Person& person) const {
    std::vector<double> distances;
    const auto& points = std::next(reference_.frames.begin(), frame)->second;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const std::optional<int> index = layout_.find(reference_.names[i]);
      if (!points[i] || !index || person[static_cast<std::size_t>(*index)].confidence <= 0.0f) continue;
      const Eigen::Vector3d world(points[i]->z(), points[i]->x(), points[i]->y());
      const Keypoint& point = person[static_cast<std::size_t>(*index)];
      distances.push_back((cameras_[camera].project(world) - Eigen::Vector2d(point.x, point.y)).norm());
    }
    if (distances.empty()) return HUGE_VAL;
    std::sort(distances.begin(), distances.end());
    return distances[distances.size() / 2];
  }

  std::vector<Camera> cameras_;
  PointLayout layout_;
  SpacePoints reference_;
  std::vector<std::vector<People>> frames_;
};

TEST_F(RealPersonChoice, IsTheManInEveryFrameAndCamera) {
  const PersonChoice choice = follow_people(frames_, cameras_, layout_);
  EXPECT_FALSE(choice.ambiguous);
  EXPECT_TRUE(choice.doubts(cameras_).empty()) << choice.doubts(cameras_)[0];
  ASSERT_EQ(choice.person, 0);
  EXPECT_EQ(choice.people[0].frames, 1.0);
  EXPECT_LT(choice.people[0].residual, 0.01);
  int others = 0, parts = 0;
  for (long f = 0; f < 100; ++f)
    for (std::size_t c = 0; c < 4; ++c) {
      const People& people = frames_[static_cast<std::size_t>(f)][c];
      const int chosen = choice.chosen[static_cast<std::size_t>(f)][c];
      ASSERT_GE(chosen, 0) << f << " " << c;
      const double of_man = distance(f, c, people[static_cast<std::size_t>(chosen)]);
      EXPECT_LT(of_man, 60.0) << f << " " << c;
      for (std::size_t i = 0; i < people.size(); ++i) {
        if (static_cast<int>(i) == chosen) continue;
        const double of_other = distance(f, c, people[i]);
        others += of_other > 200.0;
        parts += of_other <= 200.0;
      }
    }
  EXPECT_EQ(others, 200) << "another person is there in all frames of two cameras";
  EXPECT_EQ(parts, 1) << "once the detector splits the man in two";
}

TEST_F(RealPersonChoice, StaysTheManWhenASwappedViewAndAWrongCameraAreThere) {
  const std::vector<int> mirrored = mirrored_indices(layout_.points);
  for (std::size_t f = 20; f < 40; ++f)
    for (Person& person : frames_[f][2]) {
      const Person before = person;
      for (std::size_t i = 0; i < before.size(); ++i) person[static_cast<std::size_t>(mirrored[i])] = before[i];
    }
  std::vector<Camera> cameras = cameras_;
  cameras[3].t += Eigen::Vector3d(1.0, 0.5, 0.0);
  const PersonChoice choice = follow_people(frames_, cameras, layout_);
  ASSERT_EQ(choice.person, 0);
  for (long f = 0; f < 100; ++f)
    for (std::size_t c = 0; c < 3; ++c) {
      const int chosen = choice.chosen[static_cast<std::size_t>(f)][c];
      ASSERT_GE(chosen, 0) << f << " " << c;
      const bool swapped = c == 2 && f >= 20 && f < 40;
      EXPECT_LT(distance(f, c, frames_[static_cast<std::size_t>(f)][c][static_cast<std::size_t>(chosen)]),
                swapped ? 300.0 : 60.0);
    }
  EXPECT_LT(choice.cameras[3], 0.02);
}

}  // namespace
}  // namespace doppel::real_keypoints_test
