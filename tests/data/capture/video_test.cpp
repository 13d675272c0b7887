#include "doppel/data/capture/video.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <opencv2/imgcodecs.hpp>

#include "data/capture/capture_fixture.h"
#include "doppel/core/error.h"
#include "doppel/data/capture/mask_values.h"
#include "doppel/data/capture/video_file.h"
#include "support/message_of.h"
#include "support/oriented_image.h"
#include "support/png_writer.h"
#include "support/turned_video.h"

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

TEST(VideoReference, ReadsImagesOfAFolderPerFrame) {
  const support::TemporaryFolder folder;
  const std::vector<cv::Mat> frames = grey_steps(6);
  for (const int f : {2, 3, 5}) {
    const auto own = folder / ("frame_" + std::to_string(f));
    std::filesystem::create_directory(own);
    cv::imwrite((own / (f == 5 ? "b.png" : "a.png")).string(), frames[f]);
  }
  const auto reader = open_frames((folder / "frame_{frame}" / "a.png").string(), PixelFormat::grey);
  EXPECT_EQ(reader->num_frames(0), 4);
  EXPECT_EQ(reader->read(2).at<std::uint8_t>(0, 0), 20);
  EXPECT_EQ(reader->read(3).at<std::uint8_t>(0, 0), 30);
  EXPECT_THROW(reader->read(5), FileError);
}

TEST(VideoReference, SixteenBitAndAlphaBecomeBytes) {
  const support::TemporaryFolder folder;
  cv::imwrite((folder / "0.png").string(), cv::Mat(4, 4, CV_16U, cv::Scalar(65535)));
  cv::imwrite((folder / "1.png").string(), cv::Mat(4, 4, CV_8UC4, cv::Scalar(1, 2, 3, 255)));
  const auto reader = open_frames((folder / "{frame}.png").string(), PixelFormat::colour);
  EXPECT_EQ(reader->read(0).at<cv::Vec3b>(0, 0), cv::Vec3b(255, 255, 255));
  EXPECT_EQ(reader->read(1).at<cv::Vec3b>(0, 0), cv::Vec3b(1, 2, 3));
}

/// Four quarters of grey, w x h.
cv::Mat quarters(int width, int height) {
  cv::Mat image(height, width, CV_8UC3, cv::Scalar::all(20));
  image(cv::Rect(width / 2, 0, width / 2, height / 2)).setTo(cv::Scalar::all(90));
  image(cv::Rect(0, height / 2, width / 2, height / 2)).setTo(cv::Scalar::all(160));
  image(cv::Rect(width / 2, height / 2, width / 2, height / 2)).setTo(cv::Scalar::all(230));
  return image;
}

/// Lossy codecs change single pixels at borders.
void expect_shown(const cv::Mat& found, const cv::Mat& shown) {
  ASSERT_EQ(found.size(), shown.size());
  EXPECT_LT(cv::norm(found, shown, cv::NORM_L1) / static_cast<double>(shown.total() * shown.channels()), 4.0);
}

/// The number of EXIF for quarter turns clockwise.
constexpr int kExifOfQuarters[] = {1, 6, 3, 8};

/// A video of three frames whose metadata turn it, so that players show `shown`.
void write_turned(const fs::path& file, const cv::Mat& shown, int quarters) {
  const cv::Mat stored = support::stored_for(shown, kExifOfQuarters[quarters]);
  VideoFile video(file, stored.size(), 25.0);
  for (int f = 0; f < 3; ++f) video.write(stored);
  video.close();
  support::turn_video(file, quarters);
}

TEST(VideoReference, IsTurnedAsItsMetadataSay) {
  const support::TemporaryFolder folder;
  const std::string file = (folder / "phone.mp4").string();
  for (int turns = 0; turns < 4; ++turns)
    for (const cv::Mat& shown : {quarters(64, 96), quarters(64, 64)}) {
      SCOPED_TRACE(fmt::format("{} quarter turns, {} rows", turns, shown.rows));
      write_turned(file, shown, turns);
      const auto reader = open_frames(file, PixelFormat::colour);
      EXPECT_EQ(reader->size(), shown.size());
      EXPECT_EQ(reader->num_frames(3), 3);
      for (const long frame : {0L, 2L}) expect_shown(reader->read(frame), shown);
      const std::vector<cv::Mat> samples = reader->samples(2);
      ASSERT_EQ(samples.size(), 2u);
      for (const cv::Mat& sample : samples) expect_shown(sample, shown);
      cv::Mat mask;
      cv::cvtColor(shown, mask, cv::COLOR_BGR2GRAY);
      expect_shown(open_frames(file, PixelFormat::mask)->read(1), mask);
      const FootageFacts facts = inspect_footage(file);
      EXPECT_EQ(cv::Size(facts.width, facts.height), shown.size());
    }
}

TEST(VideoRejects, TurnsByHalfARightAngle) {
  const support::TemporaryFolder folder;
  write_turned(folder / "v.mp4", quarters(64, 64), 0);
  support::set_matrix(folder / "v.mp4", {0.70710678, 0.70710678, -0.70710678, 0.70710678});
  EXPECT_THAT(support::message_of<FileError>([&] { open_frames((folder / "v.mp4").string(), PixelFormat::colour); }),
              ::testing::HasSubstr("turn it by 45 degrees; quarter turns are allowed"));
}

TEST(VideoReference, ImagesAreTurnedAsTheirExifDataSay) {
  const support::TemporaryFolder folder;
  const cv::Mat shown = quarters(64, 96);
  for (const std::string extension : {".jpg", ".png"})
    for (int orientation = 1; orientation <= 8; ++orientation) {
      SCOPED_TRACE(extension + " " + std::to_string(orientation));
      support::write_bytes(folder / ("0" + extension), support::oriented_file(shown, extension, orientation));
      const auto reader = open_frames((folder / "{frame}").string() + extension, PixelFormat::colour);
      EXPECT_EQ(reader->size(), shown.size());
      expect_shown(reader->read(0), shown);
      const FootageFacts facts = inspect_footage((folder / ("0" + extension)).string());
      EXPECT_EQ(cv::Size(facts.width, facts.height), shown.size());
    }
}

class MaskFiles : public ::testing::Test {
 protected:
  void write(const std::string& name, const cv::Mat& image) const { cv::imwrite((folder_ / name).string(), image); }
  void write(const std::string& name, const std::string& bytes) const { support::write_bytes(folder_ / name, bytes); }
  cv::Mat read(const std::string& pattern, long frame = 0) const {
    return open_frames((folder_ / pattern).string(), PixelFormat::mask)->read(frame).clone();
  }
  /// The values of a mask of one row.
  std::vector<int> row(const std::string& pattern) const {
    const cv::Mat mask = read(pattern);
    return {mask.begin<unsigned char>(), mask.end<unsigned char>()};
  }
  support::TemporaryFolder folder_;
};

/// The person on the left, softly; 6 x 4.
cv::Mat soft_mask() {
  cv::Mat mask(4, 6, CV_8U, cv::Scalar(0));
  mask.colRange(0, 2) = cv::Scalar(255);
  mask.col(2) = cv::Scalar(100);
  return mask;
}

cv::Mat with_alpha(const cv::Scalar& colour, const cv::Mat& alpha) {
  cv::Mat image;
  cv::merge(std::vector<cv::Mat>{cv::Mat(alpha.size(), CV_8U, colour[0]), cv::Mat(alpha.size(), CV_8U, colour[1]),
                                 cv::Mat(alpha.size(), CV_8U, colour[2]), alpha},
            image);
  return image;
}

TEST_F(MaskFiles, AnAlphaChannelThatVariesIsTheMask) {
  const std::map<std::string, cv::Scalar> colours{
      {"cut out", {40, 90, 200}}, {"white", cv::Scalar::all(255)}, {"black", {}}};
  for (const auto& [name, colour] : colours)
    for (const int orientation : {1, 6}) {
      write("0.png", support::oriented_file(with_alpha(colour, soft_mask()), ".png", orientation));
      EXPECT_EQ(cv::norm(read("{frame}.png"), soft_mask(), cv::NORM_INF), 0.0) << name << " " << orientation;
    }
  write("0.webp", support::oriented_file(with_alpha({40, 90, 200}, soft_mask()), ".webp", 8));
  EXPECT_EQ(cv::norm(read("{frame}.webp"), soft_mask(), cv::NORM_INF), 0.0);
  cv::Mat deep;
  with_alpha({1, 2, 3}, soft_mask()).convertTo(deep, CV_16U, 257.0);
  write("0.png", deep);
  EXPECT_EQ(cv::norm(read("{frame}.png"), soft_mask(), cv::NORM_INF), 0.0) << "16 bits";
  write("0.png", support::png_file(3, 8, 4, {"\xFF\xC8\xFF\x64\xFF\x05"}));
  EXPECT_THAT(row("{frame}.png"), ::testing::ElementsAre(200, 100, 5)) << "grey and alpha";
}

TEST_F(MaskFiles, AConstantAlphaChannelIsIgnored) {
  for (const int alpha : {0, 128, 255}) {
    cv::Mat image = with_alpha({}, cv::Mat(4, 6, CV_8U, cv::Scalar(alpha)));
    image.colRange(0, 3) = cv::Scalar(200, 200, 200, alpha);
    write("0.png", image);
    const cv::Mat mask = read("{frame}.png");
    EXPECT_EQ(mask.at<unsigned char>(1, 1), 200) << alpha;
    EXPECT_EQ(mask.at<unsigned char>(1, 4), 0) << alpha;
  }
}

TEST_F(MaskFiles, NobodyIsInAFrameThatIsTransparentAmongOthers) {
  for (int frame = 0; frame < 50; ++frame)
    write(std::to_string(frame) + ".png",
          with_alpha({40, 90, 200}, frame / 10 == 2 ? soft_mask() : cv::Mat(4, 6, CV_8U, cv::Scalar(0))));
  for (const long frame : {0L, 49L}) EXPECT_EQ(cv::countNonZero(read("{frame}.png", frame)), 0) << frame;
  EXPECT_EQ(cv::norm(read("{frame}.png", 25), soft_mask(), cv::NORM_INF), 0.0);
}

TEST_F(MaskFiles, LabelsOfAnyDepthAndColourAreNotBlack) {
  const cv::Vec3b red(0, 0, 128), dark_blue(1, 0, 0), black(0, 0, 0);
  write("0.png", cv::Mat(cv::Mat_<cv::Vec3b>({1, 3}, {red, dark_blue, black})));
  EXPECT_THAT(row("{frame}.png"), ::testing::ElementsAre(38, 1, 0)) << "colours";
  write("0.png", cv::Mat(cv::Mat_<unsigned short>({1, 5}, {0, 1, 258, 32896, 65535})));
  EXPECT_THAT(row("{frame}.png"), ::testing::ElementsAre(0, 1, 2, 128, 255)) << "16 bits";
  const std::string palette = support::png_chunk("PLTE", std::string("\0\0\0\x80\0\0\0\x80\0", 9));
  write("0.png", support::png_file(3, 8, 3, {std::string("\0\1\2", 3)}, palette));
  EXPECT_THAT(row("{frame}.png"), ::testing::ElementsAre(0, 38, 75)) << "palette";
  write("0.png", support::png_file(3, 2, 3, {"\x18"}, palette));
  EXPECT_THAT(row("{frame}.png"), ::testing::ElementsAre(0, 38, 75)) << "palette of two bits";
  write("0.png", support::png_file(8, 1, 0, {"\xC1"}));
  EXPECT_THAT(row("{frame}.png"), ::testing::ElementsAre(255, 255, 0, 0, 0, 0, 0, 255)) << "one bit";
}

/// A mask with these values, one pixel each.
cv::Mat pixels(const std::vector<unsigned char>& values) { return cv::Mat(values, true).reshape(1, 1); }
/// All values up to the highest, as in a mask with wide soft borders.
cv::Mat ramp(int highest) {
  std::vector<unsigned char> values;
  for (int value = 0; value <= highest; ++value) values.push_back(static_cast<unsigned char>(value));
  return pixels(values);
}

TEST_F(MaskFiles, LabelsAndDimMasksNeedAnotherThreshold) {
  const auto look = [&](const cv::Mat& mask) {
    write("0.png", mask);
    return look_at_masks((folder_ / "{frame}.png").string());
  };
  const auto needed = [&](const cv::Mat& mask) { return look(mask).needed_threshold(); };
  EXPECT_EQ(needed(pixels({0, 1, 1})), 1);
  EXPECT_EQ(needed(pixels({0, 0, 38})), 1);
  EXPECT_EQ(needed(pixels({0, 1, 2, 15, 127})), 1);
  EXPECT_EQ(needed(pixels({1, 2})), 2) << "the background is not black";
  EXPECT_EQ(needed(ramp(100)), 50);
  for (const cv::Mat& usual :
       {pixels({0, 255}), pixels({0, 127, 255, 255, 255}), ramp(255), pixels({0, 0}), pixels({1, 1})})
    EXPECT_EQ(needed(usual), std::nullopt) << usual;
  EXPECT_TRUE(look(pixels({0, 38, 75, 147})).has_dark_labels());
  EXPECT_FALSE(look(pixels({0, 127, 255, 255, 255})).has_dark_labels()) << "a few shadows";
  EXPECT_FALSE(look(ramp(255)).has_dark_labels());
  EXPECT_EQ(look(pixels({0, 38, 0})).to_string(), "0, 38");
  EXPECT_EQ(look(ramp(97)).to_string(), "0 to 97");
}

TEST_F(MaskFiles, SomeOfALongRecordingAreLookedAt) {
  std::vector<cv::Mat> frames(60, cv::Mat(20, 30, CV_8U, cv::Scalar(0)));
  for (int f = 20; f < 40; ++f) frames[f] = cv::Mat(20, 30, CV_8U, cv::Scalar(1));
  test_capture::write_video(folder_ / "v.mkv", "FFV1", frames);
  test_capture::write_images(folder_ / "images", frames);
  EXPECT_EQ(look_at_masks((folder_ / "v.mkv").string()).to_string(), "0, 1");
  EXPECT_EQ(look_at_masks((folder_ / "images/{frame:04}.png").string()).to_string(), "0, 1");
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
