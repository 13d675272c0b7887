#include "doppel/data/capture/frame_clock.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "data/capture/capture_fixture.h"
#include "doppel/data/capture/evidence.h"
#include "doppel/data/capture/fractional_frames.h"
#include "doppel/data/capture/video.h"
#include "support/hostile_files.h"
#include "support/message_of.h"

namespace doppel::frame_clock_test {
namespace {

using support::message_of;
using support::replaced;
using ::testing::HasSubstr;

TEST(FrameClockReference, RowsFallOnTheNearestFrame) {
  const FrameClock whole{1.0, 3.0}, half{1.0, 0.5}, slow{0.5, 0.0}, fast{59.94 / 25.0, -1.25};
  EXPECT_TRUE(whole.is_whole());
  EXPECT_EQ(whole.frame(7), 10);
  EXPECT_EQ(half.frame(7), 8) << "a half is rounded up";
  EXPECT_FALSE(half.is_whole());
  EXPECT_EQ(slow.frame(6), 3);
  EXPECT_EQ(slow.frame(7), 4);
  for (const long row : {0L, 10L, 1000L})
    EXPECT_EQ(fast.frame(row), static_cast<long>(std::floor(static_cast<double>(row) * 2.3976 - 1.25 + 0.5)));
}

TEST(FrameClockReference, CountsTheRowsThatAVideoHas) {
  for (const double rate : {0.3, 0.5, 1.0, 59.94 / 60.0, 2.4, 7.0})
    for (const double offset : {-3.0, -0.5, 0.0, 0.25, 0.5, 2.0})
      for (const long frames : {0L, 1L, 2L, 99L, 100L}) {
        const FrameClock clock{rate, offset};
        const long rows = clock.num_rows(frames);
        ASSERT_GE(rows, 0);
        EXPECT_LT(rows == 0 ? -1 : clock.frame(rows - 1), frames) << rate << " " << offset << " " << frames;
        EXPECT_GE(clock.frame(rows), frames) << rate << " " << offset << " " << frames;
      }
}

TEST(FractionalFrames, PointsMoveLinearlyAndKeepTheLowerConfidence) {
  const std::vector<Keypoint> before{{10, 20, 0.9f}, {1, 1, 0.0f}, {5, 5, 0.5f}},
      after{{20, 0, 0.6f}, {3, 3, 1.0f}, {0, 0, 0.0f}};
  const std::vector<Keypoint> quarter = keypoints_between(before, after, 0.25);
  EXPECT_FLOAT_EQ(quarter[0].x, 12.5f);
  EXPECT_FLOAT_EQ(quarter[0].y, 15.0f);
  EXPECT_FLOAT_EQ(quarter[0].confidence, 0.6f);
  for (const std::size_t unseen : {1u, 2u}) {
    EXPECT_EQ(quarter[unseen].confidence, 0.0f);
    EXPECT_EQ(quarter[unseen].x, 0.0f);
  }
}

/// A person with one point that moves 4 pixels to the right in each frame.
struct MovingPoint {
  KeypointMap map;
  std::vector<Marker> landmarks{Marker{}};
  Camera camera = test_capture::ring_camera(0, 3);
  std::vector<long> asked;

  MovingPoint() {
    landmarks[0].name = "Nose";
    map = map_of_names(landmarks);
  }
  KeypointTrack follow(const FrameClock& clock, long last, long frames) {
    const auto people = [&](long frame) -> std::optional<People> {
      asked.push_back(frame);
      if (frame < 0 || frame >= frames) return std::nullopt;
      return People{{{10.0f + 4.0f * static_cast<float>(frame), 30.0f, 0.8f}}};
    };
    return follow_person(
        people, [](long) { return cv::Mat(); }, LandmarkPicker(map, landmarks), camera, {0, last, {}, clock},
        KeypointFilter());
  }
};

TEST(FractionalFrames, KeypointsAreInterpolatedBetweenFrames) {
  MovingPoint person;
  const FrameClock clock{59.94 / 60.0, 0.25};
  const KeypointTrack track = person.follow(clock, 9, 100);
  ASSERT_EQ(track.frames.size(), 10u);
  for (long row = 0; row < 10; ++row)
    EXPECT_NEAR(track.frames[static_cast<std::size_t>(row)][0].x, 10.0 + 4.0 * clock.time(row), 1e-4) << row;
  std::vector<long> once = person.asked;
  std::sort(once.begin(), once.end());
  EXPECT_EQ(std::adjacent_find(once.begin(), once.end()), once.end()) << "every frame is read once";
}

TEST(FractionalFrames, WholeFramesReadNoNeighbours) {
  MovingPoint person;
  const KeypointTrack track = person.follow({1.0, 2.0}, 4, 7);
  EXPECT_EQ(person.asked, (std::vector<long>{2, 3, 4, 5, 6}));
  EXPECT_EQ(track.facts.missing_files, 0);
  EXPECT_FLOAT_EQ(track.frames[4][0].x, 34.0f);
}

TEST(FractionalFrames, TheLastRowHasNoKeypointsBehindTheLastFrame) {
  MovingPoint person;
  const KeypointTrack track = person.follow({1.0, 0.4}, 4, 5);
  EXPECT_GT(track.frames[3][0].confidence, 0.0f);
  EXPECT_EQ(track.frames[4][0].confidence, 0.0f) << "frame 5 does not exist";
  EXPECT_EQ(track.facts.missing_files, 0) << "the nearest frame of the last row does";
}

// Camera 1 filmed at half the rate: its rows fall on every frame twice, a half frame between.
TEST(FrameClockOfACapture, ACameraMayHaveItsOwnRate) {
  test_capture::Options options;
  options.videos = false;
  const test_capture::CaptureFixture fixture(options);
  fixture.write_yaml(replaced(fixture.yaml(), "fps: 25\n", "fps: 25\ncamera_fps: {\"1\": 50}\n"));
  PrepareOptions prepare = fixture.prepare_options();
  prepare.force = true;  // its masks are now those of other poses
  EXPECT_THAT(message_of([&] { prepare_capture(fixture.capture(), prepare); }), HasSubstr("2 frames per row"));
  fixture.write_yaml(replaced(fixture.yaml(), "fps: 25\n", "fps: 25\ncamera_fps: {\"1\": 12.5}\n"));
  prepare_capture(fixture.capture(), prepare);
  const Dataset dataset = Dataset::open(fixture.out());
  const auto stored = [&](long row) { return dataset.mask({0, row}, 1); };
  const auto filmed = [&](int frame) {
    return cv::imread((fixture.root() / "training/masks/1" / (test_capture::padded(frame, 4) + ".png")).string(),
                      cv::IMREAD_GRAYSCALE);
  };
  for (const auto& [row, frame] : {std::pair(0L, 0), std::pair(1L, 1), std::pair(2L, 1), std::pair(11L, 6)})
    EXPECT_EQ(cv::countNonZero(stored(row) != filmed(frame)), 0) << "row " << row;
}

TEST(FrameClockOfACapture, OffsetsMayBeFractions) {
  const test_capture::CaptureFixture fixture;
  fixture.write_yaml(fixture.yaml("    cuts: [5]\n    frame_offset: {\"2\": 1.5}\n    last_frame: 9\n"));
  const Capture capture = fixture.capture();
  const FrameClock clock = capture.clock(capture.sequences[0], "2");
  EXPECT_DOUBLE_EQ(clock.offset, 1.5);
  EXPECT_EQ(clock.frame(9), 11);
  EXPECT_TRUE(capture.clock(capture.sequences[0], "0").is_whole());
  PrepareOptions prepare = fixture.prepare_options();
  prepare.force = true;
  prepare_capture(capture, prepare);  // frames 2 to 11 of camera 2, in a video: each is read
  EXPECT_EQ(read_capture(fixture.out()).sequences[0].frame_offset.at("2"), 1.5);
}

TEST(FrameClockOfACapture, AVideoGivesAFrameTwice) {
  const test_capture::CaptureFixture fixture;
  const auto video = open_frames((fixture.root() / "training/videos/00.avi").string(), PixelFormat::colour);
  const cv::Mat first = video->read(3).clone(), again = video->read(3).clone(), next = video->read(4).clone();
  EXPECT_EQ(cv::norm(first, again), 0.0);
  EXPECT_GT(cv::norm(first, next), 0.0);
}

}  // namespace
}  // namespace doppel::frame_clock_test
