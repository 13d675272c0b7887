#include "doppel/data/capture/people_in_cameras.h"

#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>

#include "detect/keypoints/camera_ring.h"
#include "detect/keypoints/standing_person.h"
#include "doppel/calibration/formats/read_calibration.h"
#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/data/capture/filmed_sequence.h"
#include "doppel/data/capture/person_tracks.h"
#include "doppel/detect/keypoints/keypoint_map.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::people_in_cameras_test {
namespace {

using Eigen::Vector3d;
using support::message_of;
using support::TemporaryFolder;
using ::testing::HasSubstr;

constexpr int kCameras = 4, kRows = 12;

const PointLayout& layout() {
  static const PointLayout body25 = read_keypoint_map("body25").layout;
  return body25;
}

/// Two people stand a metre apart and sway. @param time in rows
Vector3d position_of(int person, double time) {
  return {person == 0 ? -0.5 : 0.5, 0.0, 0.05 * std::sin(0.7 * time + person)};
}

Person seen_person(const Camera& camera, int person, double time) {
  const auto body = test_keypoints::standing_body(layout());
  Person points(body.size());
  for (std::size_t k = 0; k < body.size(); ++k) {
    if (!body[k]) continue;
    const Eigen::Vector2d pixel = camera.project(position_of(person, time) + *body[k]);
    points[k] = {static_cast<float>(pixel.x()), static_cast<float>(pixel.y()), 0.8f};
  }
  return points;
}

/// The index of a person among the detections of a frame: it changes from frame to frame.
int index_of(int person, long frame, int camera) { return (person + static_cast<int>(frame) + camera) % 2; }

/// Both people in all cameras; camera 2 films two frames per row and began half a frame late.
PeopleInCameras two_people() {
  PeopleInCameras seen{"walk", test_keypoints::camera_ring(kCameras), {}, {}, 1, kRows};
  for (int c = 0; c < kCameras; ++c) {
    const FrameClock clock = c == 2 ? FrameClock{2.0, 0.5} : FrameClock{};
    seen.clocks.push_back(clock);
    const Camera& camera = seen.cameras[c];
    seen.people.emplace_back([camera, clock, c](long frame) -> std::optional<People> {
      const double row = (static_cast<double>(frame) - clock.offset) / clock.rate;
      People people(2);
      for (int p = 0; p < 2; ++p) people[index_of(p, frame, c)] = seen_person(camera, p, row);
      return people;
    });
  }
  return seen;
}

/// Every frame that a row needs, neighbours included, shows this person.
void expect_person(const PeopleInCameras& seen, const std::vector<ChoiceOfFrame>& chosen, int person) {
  ASSERT_EQ(chosen.size(), as_size(kCameras));
  for (int c = 0; c < kCameras; ++c)
    for (long row = seen.first_row; row <= seen.last_row; ++row) {
      const double time = seen.clocks[c].time(row);
      for (const double frame : {std::floor(time), std::ceil(time)})
        EXPECT_EQ(chosen[c](static_cast<long>(frame)), index_of(person, static_cast<long>(frame), c))
            << "camera " << c << ", frame " << frame;
    }
}

TEST(PeopleInCameras, ANamedPersonIsFollowedInAllCameras) {
  const PeopleInCameras seen = two_people();
  for (const int person : {0, 1}) {
    PersonChoiceOptions options;
    options.near = position_of(person, 0.0) + Vector3d(0.05, 0.9, 0.0);
    expect_person(seen, follow_if_several(seen, layout(), options, {}), person);
  }
}

TEST(PeopleInCameras, OfEqualPeopleTheMasksDecide) {
  const PeopleInCameras seen = two_people();
  for (const int person : {0, 1}) {
    const auto mask = [&](std::size_t camera, long row) {
      const Camera& view = seen.cameras[camera];
      cv::Mat image(view.height, view.width, CV_8U, cv::Scalar(0));
      Camera pinhole = view;
      pinhole.distortion = {};
      for (const Keypoint& point : seen_person(pinhole, person, static_cast<double>(row)))
        if (point.confidence > 0) cv::circle(image, cv::Point2f(point.x, point.y), 6, 255, -1);
      return image;
    };
    expect_person(seen, follow_if_several(seen, layout(), {}, mask), person);
  }
}

TEST(PeopleInCameras, NothingIsChosenWhereNobodyElseIs) {
  PeopleInCameras seen = two_people();
  for (PeopleOfFrame& people : seen.people)
    people = [all = people](long frame) -> std::optional<People> { return People{all(frame)->at(0)}; };
  for (const ChoiceOfFrame& chosen : follow_if_several(seen, layout(), {}, {})) EXPECT_FALSE(chosen);
  seen.cameras.resize(1);
  EXPECT_FALSE(follow_if_several(seen, layout(), {}, {}).at(0)) << "one camera";
}

/// A capture of OpenPose's files of both people; the second camera filmed two frames earlier.
class TwoPeopleOnDisk {
 public:
  explicit TwoPeopleOnDisk(const std::string& person) {
    const std::vector<Camera> cameras = test_keypoints::camera_ring(kCameras);
    write_calibration(folder_ / "cameras.yml", cameras);
    for (int c = 0; c < kCameras; ++c)
      for (int frame = 0; frame < kRows + 2; ++frame) write_frame(cameras[c], c, frame);
    support::write_bytes(folder_ / "capture.yaml",
                         "doppel_capture: 1\nname: two\ncalibration: cameras.yml\nfps: 50\n" + person +
                             "sequences:\n  - {name: walk, split: test, videos: 'none_{name}.mp4', last_frame: 11, "
                             "keypoints: '{name}_{frame}.json', frame_offset: {c1: 2}}\n");
  }
  Capture capture() const { return read_capture(folder_.path()); }
  static double row_of(int camera, long frame) { return static_cast<double>(frame) - (camera == 1 ? 2.0 : 0.0); }

 private:
  void write_frame(const Camera& camera, int c, int frame) {
    nlohmann::json people = nlohmann::json::array({nlohmann::json(), nlohmann::json()});
    for (int p = 0; p < 2; ++p) {
      std::vector<float> values;
      for (const Keypoint& point : seen_person(camera, p, row_of(c, frame)))
        values.insert(values.end(), {point.x, point.y, point.confidence});
      people[index_of(p, frame, c)] = {{"pose_keypoints_2d", values}};
    }
    support::write_bytes(folder_ / (camera.name + "_" + std::to_string(frame) + ".json"),
                         nlohmann::json{{"version", 1.3}, {"people", people}}.dump());
  }
  TemporaryFolder folder_;
};

TEST(PersonTracks, AreTheChosenPersonsPointsInFramesOfEachVideo) {
  const TwoPeopleOnDisk files("person: {near: [0.5, 1, 0]}\n");
  const Capture capture = files.capture();
  const PointTracks tracks = read_person_tracks(capture, capture.sequences.at(0), filmed_cameras(capture));
  EXPECT_EQ(tracks.points, layout().points) << "25 points, told from BODY_25B by the limbs";
  ASSERT_EQ(tracks.num_cameras(), kCameras);
  const std::vector<Camera> cameras = test_keypoints::camera_ring(kCameras);
  for (int c = 0; c < kCameras; ++c) {
    const CameraTrack& track = tracks.cameras[c];
    EXPECT_EQ(track.name, cameras[c].name);
    EXPECT_EQ(track.fps, 50.0);
    EXPECT_EQ(track.offset, c == 1 ? 2.0 : 0.0);
    ASSERT_EQ(track.num_frames(), c == 1 ? 14 : 12);
    for (long frame = 0; frame < track.num_frames(); ++frame) {
      const Person ground_truth = seen_person(cameras[c], 1, TwoPeopleOnDisk::row_of(c, frame));
      const bool used = c != 1 || frame >= 2;
      for (int k = 0; k < track.num_points(); ++k) {
        const TrackPoint& point = track.at(frame, k);
        EXPECT_EQ(point.seen(), used && ground_truth[k].confidence > 0.0f);
        if (!point.seen()) continue;
        EXPECT_EQ(point.pixel, Eigen::Vector2d(ground_truth[k].x, ground_truth[k].y));
      }
    }
  }
}

TEST(PersonTracks, NeedFilesAndAPersonWhoIsThere) {
  const TwoPeopleOnDisk files("person: 7\n");
  Capture capture = files.capture();
  EXPECT_THAT(
      message_of<UsageError>([&] { read_person_tracks(capture, capture.sequences[0], filmed_cameras(capture)); }),
      HasSubstr("person 7 was asked for, and 2 people were found"));
  capture.sequences[0].keypoints = CameraPaths();
  EXPECT_THAT(message_of<Error>([&] { read_person_tracks(capture, capture.sequences[0], filmed_cameras(capture)); }),
              HasSubstr("doppel detect"));
}

}  // namespace
}  // namespace doppel::people_in_cameras_test
