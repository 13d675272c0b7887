#include "doppel/track/live/frame_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "doppel/core/error.h"
#include "doppel/core/process.h"
#include "doppel/data/capture/video_file.h"
#include "support/message_of.h"
#include "support/oriented_image.h"
#include "support/temporary_folder.h"
#include "support/turned_video.h"

namespace doppel::frame_source_test {
namespace {

using support::message_of;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

cv::Mat grey(int value) { return cv::Mat(32, 48, CV_8UC3, cv::Scalar::all(value)); }

std::vector<long> numbers(FrameSource& source) {
  std::vector<long> result;
  while (const auto image = source.next()) {
    EXPECT_EQ(image->number, static_cast<long>(result.size()));
    result.push_back(image->frame);
  }
  return result;
}

class Sources : public ::testing::Test {
 protected:
  Sources() {
    std::filesystem::create_directory(folder_ / "pictures");
    for (const int i : {2, 0, 1})
      cv::imwrite((folder_ / fmt::format("pictures/{}.png", 8 + i)).string(), grey(50 + 60 * i));
    std::ofstream(folder_ / "pictures/notes.txt") << "not an image";
    VideoFile video(folder_ / "film.mp4", {48, 32}, 50.0);
    for (int i = 0; i < 4; ++i) video.write(grey(40 * i));
    video.close();
  }
  support::TemporaryFolder folder_;
};

TEST_F(Sources, AFolderComesInTheOrderOfItsNames) {
  const auto source = open_source((folder_ / "pictures").string());
  EXPECT_EQ(source->size(), cv::Size(48, 32));
  EXPECT_EQ(source->frames_per_second(), 25.0);
  EXPECT_FALSE(source->live());
  for (const int value : {50, 110, 170}) EXPECT_EQ(source->next()->image.at<cv::Vec3b>(5, 5)[1], value);
  EXPECT_FALSE(source->next());
}

TEST_F(Sources, FilesAreTurnedAsTheirMetadataSay) {
  cv::Mat shown(48, 32, CV_8UC3, cv::Scalar::all(30));
  shown.rowRange(0, 24) = cv::Scalar::all(200);
  const cv::Mat stored = support::stored_for(shown, 6);
  VideoFile video(folder_ / "phone.mp4", stored.size(), 25.0);
  for (int i = 0; i < 2; ++i) video.write(stored);
  video.close();
  support::turn_video(folder_ / "phone.mp4", 1);
  std::filesystem::create_directory(folder_ / "photographs");
  support::write_bytes(folder_ / "photographs/0.jpg", support::oriented_file(shown, ".jpg", 6));
  SourceOptions twice;
  twice.repeat = 2;
  for (const char* name : {"phone.mp4", "photographs"}) {
    const auto source = open_source((folder_ / name).string(), twice);
    EXPECT_EQ(source->size(), shown.size()) << name;
    int images = 0;
    for (; const auto image = source->next(); ++images) {
      ASSERT_EQ(image->image.size(), shown.size()) << name;
      EXPECT_NEAR(image->image.at<cv::Vec3b>(5, 16)[1], 200, 6) << name;
      EXPECT_NEAR(image->image.at<cv::Vec3b>(42, 16)[1], 30, 6) << name;
    }
    EXPECT_EQ(images, std::string(name) == "phone.mp4" ? 4 : 2);
  }
}

TEST_F(Sources, AVideoIsPlayedAsOftenAsWanted) {
  SourceOptions options;
  options.repeat = 3;
  const auto source = open_source((folder_ / "film.mp4").string(), options);
  EXPECT_EQ(source->frames_per_second(), 50.0);
  EXPECT_THAT(numbers(*source), ElementsAre(0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3));
}

TEST_F(Sources, AFileCanComeAtItsOwnRate) {
  SourceOptions options;
  options.live = true;
  const auto source = open_source((folder_ / "film.mp4").string(), options);
  EXPECT_TRUE(source->live());
  const auto start = Clock::now();
  EXPECT_EQ(numbers(*source).size(), 4u);
  EXPECT_GE(seconds_since(start), 0.06) << "the fourth is due after three fiftieths of a second";
}

TEST_F(Sources, ACameraThatFallsSilentIsOpenedAgain) {
  int opened = 0;
  Device device{"camera 7", [&](cv::VideoCapture& video) {
                  video.release();
                  return ++opened <= 3 && video.open((folder_ / "film.mp4").string());
                }};
  device.silence = 0.05;
  device.patience = 0.3;
  const auto source = open_device(device);
  EXPECT_EQ(source->size(), cv::Size(48, 32));
  EXPECT_EQ(source->frames_per_second(), 50.0);
  EXPECT_EQ(numbers(*source).size(), 3u * 4u) << "the film ends as a camera does whose cable was pulled";
  EXPECT_GT(opened, 4) << "it is opened again until patience ends";
  device.open = [](cv::VideoCapture&) { return false; };
  EXPECT_THAT(message_of<UsageError>([&] { open_device(device); }), HasSubstr("camera 7"));
}

TEST_F(Sources, AStopEndsThem) {
  SourceOptions options;
  options.repeat = 1000000;
  const auto source = open_source((folder_ / "film.mp4").string(), options);
  EXPECT_TRUE(source->next());
  request_stop();
  EXPECT_FALSE(source->next());
  request_stop(false);
}

TEST_F(Sources, WhatIsNoneIsNamed) {
  const auto complaint = [](const std::filesystem::path& source) {
    return message_of<Error>([&] { open_source(source.string()); });
  };
  EXPECT_THAT(complaint(folder_ / "nowhere"), HasSubstr("neither the number of a camera"));
  EXPECT_THAT(complaint("977"), HasSubstr("no such camera"));
  EXPECT_THAT(complaint(folder_ / "pictures/notes.txt"), HasSubstr("no video"));
  std::ofstream(folder_ / "empty.mp4");
  EXPECT_THAT(complaint(folder_ / "empty.mp4"), HasSubstr("no video"));
  std::filesystem::create_directory(folder_ / "nothing");
  EXPECT_THAT(complaint(folder_ / "nothing"), HasSubstr("holds no image"));
  cv::imwrite((folder_ / "pictures/11.png").string(), cv::Mat(10, 10, CV_8UC3, cv::Scalar::all(0)));
  const auto source = open_source((folder_ / "pictures").string());
  for (int i = 0; i < 3; ++i) source->next();
  EXPECT_THAT(message_of<Error>([&] { source->next(); }), HasSubstr("10 x 10 pixels"));
}

}  // namespace
}  // namespace doppel::frame_source_test
