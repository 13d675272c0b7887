#include "doppel/geometry/image_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "doppel/core/error.h"
#include "doppel/geometry/encoded_image.h"
#include "doppel/geometry/image_orientation.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/number_bytes.h"
#include "support/oriented_image.h"
#include "support/temporary_folder.h"

namespace doppel::image_file_test {
namespace {

/// Four quarters, 64 x 32: grey, because JPEG smears colours over the borders, and of different alpha.
cv::Mat quarters(int type = CV_8UC3) {
  cv::Mat image(32, 64, type, cv::Scalar(20, 20, 20, 80));
  image(cv::Rect(32, 0, 32, 16)).setTo(cv::Scalar(90, 90, 90, 160));
  image(cv::Rect(0, 16, 32, 16)).setTo(cv::Scalar(160, 160, 160, 255));
  image(cv::Rect(32, 16, 32, 16)).setTo(cv::Scalar(230, 230, 230, 0));
  return image;
}

void expect_same(const cv::Mat& found, const cv::Mat& expected, double tolerance) {
  ASSERT_EQ(found.size(), expected.size());
  ASSERT_EQ(found.type(), expected.type());
  EXPECT_LE(cv::norm(found.reshape(1), expected.reshape(1), cv::NORM_INF), tolerance);
}

TEST(ImageFile, IsReadAsViewersShowIt) {
  const support::TemporaryFolder folder;
  for (const std::string extension : {".jpg", ".png", ".webp"})
    for (int orientation = 1; orientation <= 8; ++orientation)
      for (const bool big_endian : {false, true}) {
        SCOPED_TRACE(extension + " " + std::to_string(orientation) + (big_endian ? " big" : " little"));
        const auto file = folder / ("turned" + extension);
        support::write_bytes(file, support::oriented_file(quarters(), extension, orientation, big_endian));
        expect_same(read_image(file), quarters(), extension == ".jpg" ? 6.0 : 0.0);
        expect_same(read_colour_image(file), quarters(), extension == ".jpg" ? 6.0 : 0.0);
      }
}

TEST(ImageFile, KeepsAlphaAndSixteenBitsWhenItIsTurned) {
  const support::TemporaryFolder folder;
  cv::Mat deep;
  quarters().convertTo(deep, CV_16U, 257.0);
  cv::cvtColor(deep, deep, cv::COLOR_BGR2GRAY);
  for (int orientation = 1; orientation <= 8; ++orientation) {
    SCOPED_TRACE(orientation);
    for (const cv::Mat& shown : {quarters(CV_8UC4), deep}) {
      support::write_bytes(folder / "a.png", support::oriented_file(shown, ".png", orientation));
      expect_same(read_image(folder / "a.png"), shown, 0.0);
    }
  }
}

TEST(ImageFile, FindsTheOrientationWhereverItIs) {
  std::string png = support::oriented_file(quarters(), ".png", 1);
  const std::string exif = support::exif_data(6, false);
  png = png.erase(33, 12 + exif.size()).insert(png.size() - 12, support::png_chunk("eXIf", exif));
  EXPECT_EQ(exif_orientation(png), 6) << "behind the pixels";
  std::string jpeg = support::oriented_file(quarters(), ".jpg", 8);
  const std::string xmp = "http://ns.adobe.com/xap/1.0/";
  EXPECT_EQ(exif_orientation(jpeg.insert(2, "\xFF\xE1" + support::number_bytes(xmp.size() + 2, 2, true) + xmp)), 8)
      << "behind another segment of the same kind";
}

TEST(ImageFile, WithoutASaneOrientationItIsReadAsStored) {
  const auto orientation = [](const std::string& bytes) { return exif_orientation(bytes); };
  for (const int number : {0, 9, 255}) {
    const std::string exif = std::string("Exif\0\0", 6) + support::exif_data(number, true);
    EXPECT_EQ(orientation("\xFF\xD8\xFF\xE1" + support::number_bytes(exif.size() + 2, 2, true) + exif), 1) << number;
  }
  EXPECT_EQ(orientation(""), 1);
  for (const std::string extension : {".jpg", ".png", ".webp"}) {
    const std::string valid = support::oriented_file(quarters(), extension, 6);
    for (const support::HostileFile& file : support::hostile_variants(valid)) {
      const int found = orientation(file.content);
      EXPECT_TRUE(found >= 1 && found <= 8) << file.what << ": " << found;
    }
  }
}

TEST(ImageFileRejects, WhatIsNoImage) {
  const support::TemporaryFolder folder;
  for (const std::string& content : {std::string(), std::string("no image"), std::string(5000, 'q')}) {
    support::write_bytes(folder / "a.png", content);
    EXPECT_THROW(read_image(folder / "a.png"), FileError);
    EXPECT_THROW(read_colour_image(folder / "a.png"), FileError);
  }
  EXPECT_THROW(read_image(folder / "none.png"), FileError);
}

/// A PNG file that announces a size, and holds nothing else.
std::string png_header(std::uint32_t width, std::uint32_t height) {
  std::string bytes("\x89PNG\r\n\x1a\n\0\0\0\rIHDR", 16);
  for (const std::uint32_t side : {width, height})
    for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(side >> shift & 0xff);
  return bytes + std::string("\x08\x02\0\0\0", 5) + std::string(16, '\0');
}

TEST(ImageFileRejects, MorePixelsThanAllowed) {
  EXPECT_EQ(*announced_image_size(png_header(20000, 20001)), Eigen::Vector2i(20000, 20001));
  for (const char* extension : {".png", ".jpg", ".bmp", ".tiff", ".webp"}) {
    std::vector<unsigned char> encoded;
    cv::imencode(extension, quarters(), encoded);
    const std::string bytes(encoded.begin(), encoded.end());
    EXPECT_EQ(decode_image(bytes, cv::IMREAD_UNCHANGED, 64 * 32).size(), quarters().size()) << extension;
    EXPECT_TRUE(decode_image(bytes, cv::IMREAD_UNCHANGED, 64 * 32 - 1).empty()) << extension;
  }
  const support::TemporaryFolder folder;
  support::write_bytes(folder / "bomb.png", png_header(20000, 20001));
  EXPECT_THAT(support::message_of<FileError>([&] { read_image(folder / "bomb.png"); }),
              ::testing::HasSubstr("more than 268435456 pixels"));
}

}  // namespace
}  // namespace doppel::image_file_test
