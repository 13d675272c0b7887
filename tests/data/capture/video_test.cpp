#include "doppel/data/capture/video.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "data/capture/capture_fixture.h"
#include "doppel/core/error.h"

namespace doppel::video_test {
namespace {

namespace fs = std::filesystem;

/// Frame f is filled with the grey value 10 f.
std::vector<cv::Mat> grey_steps(int count) {
  std::vector<cv::Mat> frames;
  for (int f = 0; f < count; ++f) frames.emplace_back(20, 30, CV_8U, cv::Scalar(10 * f));
  return frames;
}

TEST(VideoReference, ReadsFramesForwardAndSkips) {
  const support::TemporaryFolder folder;
  test_capture::write_video(folder / "v.mkv", "FFV1", grey_steps(9));
  const auto reader = open_frames((folder / "v.mkv").string(), PixelFormat::grey);
  EXPECT_EQ(reader->size(), cv::Size(30, 20));
  EXPECT_EQ(reader->num_frames(9), 9);
  EXPECT_EQ(reader->num_frames(12), 9);  // the header is not believed: counted
  for (const long frame : {0L, 1L, 4L, 8L}) {
    const cv::Mat image = reader->read(frame);
    ASSERT_EQ(image.type(), CV_8UC1);
    EXPECT_EQ(image.at<std::uint8_t>(3, 3), 10 * frame);
  }
  EXPECT_THROW(reader->read(9), FileError);
  EXPECT_EQ(open_frames((folder / "v.mkv").string(), PixelFormat::colour)->read(2).type(), CV_8UC3);
}

TEST(VideoReference, ReadsImagesByNumber) {
  const support::TemporaryFolder folder;
  const std::vector<cv::Mat> frames = grey_steps(6);
  for (const int f : {2, 3, 5}) cv::imwrite((folder / ("c_7_f_" + std::to_string(f) + ".png")).string(), frames[f]);
  cv::imwrite((folder / "c_7_f_003.png").string(), frames[0]);  // does not fit the pattern
  const auto reader = open_frames((folder / "c_7_f_{frame}.png").string(), PixelFormat::grey);
  EXPECT_EQ(reader->num_frames(0), 6);
  EXPECT_EQ(reader->read(3).at<std::uint8_t>(0, 0), 30);
  EXPECT_EQ(reader->read(5).at<std::uint8_t>(0, 0), 50);
  EXPECT_THROW(reader->read(4), FileError);
}

TEST(VideoReference, SixteenBitAndAlphaBecomeBytes) {
  const support::TemporaryFolder folder;
  cv::imwrite((folder / "0.png").string(), cv::Mat(4, 4, CV_16U, cv::Scalar(65535)));
  cv::imwrite((folder / "1.png").string(), cv::Mat(4, 4, CV_8UC4, cv::Scalar(1, 2, 3, 255)));
  const auto reader = open_frames((folder / "{frame}.png").string(), PixelFormat::colour);
  EXPECT_EQ(reader->read(0).at<cv::Vec3b>(0, 0), cv::Vec3b(255, 255, 255));
  EXPECT_EQ(reader->read(1).at<cv::Vec3b>(0, 0), cv::Vec3b(1, 2, 3));
}

TEST(VideoRejects, WhatIsNoVideo) {
  const support::TemporaryFolder folder;
  EXPECT_THROW(open_frames((folder / "none.mp4").string(), PixelFormat::grey), FileError);
  EXPECT_THROW(open_frames((folder / "{frame}.png").string(), PixelFormat::grey), FileError);
  EXPECT_THROW(open_frames((folder / "no/{frame}.png").string(), PixelFormat::grey), FileError);
  std::ofstream(folder / "empty.mp4").close();
  EXPECT_THROW(open_frames((folder / "empty.mp4").string(), PixelFormat::grey), FileError);
  std::ofstream(folder / "noise.mp4") << std::string(5000, 'q');
  EXPECT_THROW(open_frames((folder / "noise.mp4").string(), PixelFormat::grey), FileError);
  std::ofstream(folder / "0.png") << "no image";
  EXPECT_THROW(open_frames((folder / "{frame}.png").string(), PixelFormat::grey)->read(0), FileError);
}

}  // namespace
}  // namespace doppel::video_test
