#include "detect_masks.h"

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "doppel/detect/blazepose/mask_sharpening.h"
#include "doppel/detect/blazepose/possible_parts.h"
#include "doppel/geometry/image_file.h"
#include "support/temporary_folder.h"

namespace doppel::detect_masks_test {
namespace {

constexpr int kFrames = 8, kSide = 160;

cv::Mat ground_truth(int frame) {
  cv::Mat mask = cv::Mat::zeros(kSide, kSide, CV_8U);
  cv::ellipse(mask, {30 + 14 * frame, 80}, {16, 40}, 0, 0, 360, 255, -1);
  return mask;
}

double overlap(const cv::Mat& a, const cv::Mat& b) {
  return static_cast<double>(cv::countNonZero(a & b)) / cv::countNonZero(a | b);
}

/// Images of an ellipse that walks, and network masks that are two pixels too wide.
struct Footage {
  Footage() {
    cv::Mat noise(kSide, kSide, CV_32FC3);
    cv::RNG(5).fill(noise, cv::RNG::NORMAL, 0, 40);
    cv::GaussianBlur(noise, noise, {}, 3);
    for (int frame = 0; frame < kFrames; ++frame) {
      cv::Mat image, wide;
      noise.convertTo(image, CV_8UC3, 1.0, 110.0);
      image.setTo(cv::Scalar(40, 60, 200), ground_truth(frame));
      write_image(folder / "images" / ("run_" + std::to_string(frame) + ".png"), image);
      cv::dilate(ground_truth(frame), wide, cv::getStructuringElement(cv::MORPH_ELLIPSE, {5, 5}));
      cv::GaussianBlur(wide, wide, {}, 1.5);
      write_image(tools::mask_file(folder / "masks", frame), wide);
    }
    source = tools::detect_sources(folder / "images").at(0);
  }

  cv::Mat image(int frame) const {
    return cv::imread((folder / "images" / ("run_" + std::to_string(frame) + ".png")).string());
  }
  cv::Mat mask(int frame) const {
    return cv::imread(tools::mask_file(folder / "masks", frame).string(), cv::IMREAD_GRAYSCALE);
  }

  support::TemporaryFolder folder;
  tools::DetectSource source;
};

TEST(DetectMasks, NetworkMasksBecomeSharp) {
  const Footage footage;
  int frames = 0;
  const StaticBackground background =
      tools::learn_background_of(footage.source, [&](const cv::Mat&) { return footage.mask(frames++); });
  EXPECT_EQ(frames, kFrames);
  EXPECT_GT(background.known_share(), 0.9);
  ASSERT_LT(overlap(footage.mask(3) >= 128, ground_truth(3)), 0.93);
  for (int frame = 0; frame < kFrames; ++frame) {
    const cv::Mat mask = sharpen_mask(footage.image(frame), footage.mask(frame), background);
    EXPECT_GT(overlap(mask, ground_truth(frame)), 0.97) << frame;
    EXPECT_EQ(cv::countNonZero((mask != 0) & (mask != 255)), 0);
  }
}

TEST(DetectMasks, ImagesWithoutCalibrationAreNotCompared) {
  const Footage footage;
  const std::vector<tools::DetectSource> sources(3, footage.source);
  const std::vector<std::filesystem::path> folders(3, footage.folder / "masks");
  EXPECT_FALSE(tools::is_compared(sources[0], sources));
  EXPECT_EQ(tools::compare_masks(sources, folders, [] { return true; }).removed, 0);
}

TEST(DetectMasks, FilesKeepNoPossibleParts) {
  const Footage footage;
  tools::DetectSource source = footage.source;
  source.calibration.emplace();
  source.calibration->width = source.calibration->height = kSide;
  source.calibration->K << 100, 0, 80, 0, 100, 80, 0, 0, 1;
  const std::vector<tools::DetectSource> sources(3, source);
  std::vector<std::filesystem::path> folders;
  cv::Mat marked = ground_truth(0);
  marked(cv::Rect(100, 100, 20, 20)).setTo(kPossiblePerson);
  for (const char* camera : {"a", "b", "c"}) {
    folders.push_back(footage.folder / camera);
    for (int frame = 0; frame < kFrames; ++frame) write_image(tools::mask_file(folders.back(), frame), marked);
  }
  EXPECT_TRUE(tools::is_compared(sources[0], sources));
  EXPECT_EQ(tools::compare_masks(sources, folders, [] { return true; }).added, 0);
  for (const std::filesystem::path& folder : folders) {
    const cv::Mat mask = cv::imread(tools::mask_file(folder, 3).string(), cv::IMREAD_GRAYSCALE);
    EXPECT_EQ(cv::countNonZero(mask != ground_truth(0)), 0);
  }
}

}  // namespace
}  // namespace doppel::detect_masks_test
