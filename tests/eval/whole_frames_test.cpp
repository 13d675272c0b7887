#include "doppel/eval/whole_frames.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <opencv2/imgcodecs.hpp>

#include "doppel/calibration/formats/read_calibration.h"
#include "doppel/core/error.h"
#include "doppel/data/capture/video_file.h"
#include "doppel/data/dataset/dataset.h"
#include "doppel/geometry/undistorter.h"
#include "support/message_of.h"
#include "support/small_capture.h"
#include "support/temporary_folder.h"

namespace doppel::whole_frames_test {
namespace {

using support::message_of;
using support::TemporaryFolder;
using ::testing::HasSubstr;

double largest_difference(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() ? cv::norm(a, b, cv::NORM_INF) : 1e9;
}

class WholeFramesReference : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    SmallCaptureOptions options;
    options.mask_size = 64;
    options.train_frames = 2;
    prepared_ = make_small_capture(folder_->path(), options);
  }
  static void TearDownTestSuite() { folder_.reset(); }

  void SetUp() override {
    const Dataset dataset = Dataset::open(prepared_);
    capture_ = dataset.capture();
    cameras_ = dataset.cameras();
  }

  /// The file of a frame, as the capture has it.
  static cv::Mat filmed(const std::string& sequence, int camera, long frame) {
    const std::string name = "image_c" + std::to_string(camera) + "_" + std::to_string(frame) + ".png";
    return cv::imread((*folder_ / sequence / name).string(), cv::IMREAD_COLOR);
  }
  /// Replaces the calibration of the capture.
  void calibrate(const std::string& name, const std::vector<Camera>& cameras) {
    write_calibration(*folder_ / name, cameras);
    capture_.calibration = name;
    capture_.cameras.clear();  // all of the file
  }

  static std::unique_ptr<TemporaryFolder> folder_;
  static std::filesystem::path prepared_;
  Capture capture_;
  std::vector<PinholeCamera> cameras_;
};
std::unique_ptr<TemporaryFolder> WholeFramesReference::folder_;
std::filesystem::path WholeFramesReference::prepared_;
using WholeFramesRejects = WholeFramesReference;

TEST_F(WholeFramesReference, ReadsTheFilesOfTheCapture) {
  WholeFrames frames(capture_, cameras_[1]);
  ASSERT_GT(largest_difference(filmed("dance", 1, 0), filmed("dance", 1, 3)), 0.0);
  for (const long frame : {0L, 3L, 3L, 1L})
    EXPECT_EQ(largest_difference(frames.read("dance", frame), filmed("dance", 1, frame)), 0.0) << frame;
  EXPECT_EQ(largest_difference(frames.read("walk", 1), filmed("walk", 1, 1)), 0.0);
}

TEST_F(WholeFramesReference, CountsInRowsOfTheMotion) {
  for (SequenceEntry& entry : capture_.sequences) entry.frame_offset["c1"] = 2;
  WholeFrames shifted(capture_, cameras_[1]), other(capture_, cameras_[2]);
  EXPECT_EQ(largest_difference(shifted.read("dance", 1), filmed("dance", 1, 3)), 0.0);
  EXPECT_EQ(largest_difference(other.read("dance", 1), filmed("dance", 2, 1)), 0.0);
}

TEST_F(WholeFramesReference, RemovesTheDistortionAtTheResolutionOfTheImages) {
  Camera distorted = cameras_[1];
  distorted.distortion[0] = -0.5;
  const cv::Mat raw = filmed("dance", 1, 2), expected = Undistorter(distorted).apply(raw);
  ASSERT_GT(largest_difference(raw, expected), 5.0);
  calibrate("distorted.yml", {cameras_[0], distorted});
  EXPECT_EQ(largest_difference(WholeFrames(capture_, cameras_[1]).read("dance", 2), expected), 0.0);
  calibrate("half.yml", {cameras_[0].scaled_to(64, 64), distorted.scaled_to(64, 64)});
  EXPECT_LE(largest_difference(WholeFrames(capture_, cameras_[1]).read("dance", 2), expected), 1.0);
}

TEST_F(WholeFramesReference, DecodesVideosInAnyOrder) {
  const auto level = [](long frame) { return 20.0 + 40.0 * static_cast<double>(frame); };
  VideoFile video(*folder_ / "grey_c1.mp4", {128, 128}, 25.0);
  for (long frame = 0; frame < 5; ++frame) video.write(cv::Mat(128, 128, CV_8UC3, cv::Scalar::all(level(frame))));
  video.close();
  for (SequenceEntry& entry : capture_.sequences) entry.videos = "grey_{name}.mp4";
  WholeFrames frames(capture_, cameras_[1]);
  for (const long frame : {1L, 3L, 3L, 0L, 4L})
    EXPECT_NEAR(cv::mean(frames.read("dance", frame))[1], level(frame), 8.0) << frame;
  EXPECT_NEAR(cv::mean(frames.read("walk", 1))[1], level(1), 8.0);
}

TEST_F(WholeFramesRejects, WhatTheCaptureDoesNotHave) {
  WholeFrames frames(capture_, cameras_[1]);
  EXPECT_THAT(message_of<UsageError>([&] { frames.read("run", 0); }), HasSubstr("no sequence 'run'"));
  EXPECT_THAT(message_of<FileError>([&] { frames.read("dance", 99); }), HasSubstr("image_c1_99.png"));
  PinholeCamera unknown = cameras_[1];
  unknown.name = "c9";
  EXPECT_THAT(message_of([&] { WholeFrames(capture_, unknown); }), HasSubstr("no camera 'c9'"));
  capture_.sequences[1].videos = "gone/{name}_{frame}.png";
  EXPECT_THAT(message_of<FileError>([&] { WholeFrames(capture_, cameras_[1]).read("dance", 0); }),
              HasSubstr("gone/c1_{frame}.png"));
}

TEST_F(WholeFramesRejects, ImagesOfAnotherSize) {
  PinholeCamera small = cameras_[1];
  small.width = small.height = 64;
  EXPECT_THAT(message_of([&] { WholeFrames(capture_, small).read("dance", 0); }),
              HasSubstr("frame 0 is 128x128 pixels, but camera c1 was prepared with 64x64"));
}

}  // namespace
}  // namespace doppel::whole_frames_test
