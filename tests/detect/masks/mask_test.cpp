#include "doppel/detect/masks/mask.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "doppel/core/error.h"
#include "doppel/detect/masks/components.h"
#include "support/ring_of_cameras.h"

namespace doppel::mask_test {
namespace {

cv::Mat rectangle_mask(cv::Size size, cv::Rect rectangle) {
  cv::Mat mask = cv::Mat::zeros(size, CV_8U);
  mask(rectangle).setTo(255);
  return mask;
}

TEST(CropReference, BoxHasTheMarginAndIsSquare) {
  const CropBox box = crop_of_mask(rectangle_mask({200, 300}, {80, 100, 40, 100}), 0.1);
  EXPECT_EQ(box.side, 120);
  EXPECT_EQ(box.v0, 90);
  EXPECT_EQ(box.u0, 40);
  EXPECT_DOUBLE_EQ(box.image_pixels_per_pixel(60), 2.0);
}

TEST(CropReference, BoxIsShiftedIntoTheImageOrCentredOverIt) {
  const CropBox corner = crop_of_mask(rectangle_mask({200, 300}, {0, 0, 40, 100}), 0.1);
  EXPECT_EQ(corner.u0, 0);
  EXPECT_EQ(corner.v0, 0);
  const CropBox wide = crop_of_mask(rectangle_mask({100, 300}, {10, 20, 50, 250}), 0.1);
  EXPECT_EQ(wide.side, 300);
  EXPECT_EQ(wide.u0, -100);
  EXPECT_EQ(wide.v0, 0);
  EXPECT_TRUE(crop_of_mask(cv::Mat::zeros(10, 10, CV_8U), 0.1).empty());
}

TEST(CropReference, ProjectingIntoTheCropEqualsMappingThePixel) {
  const PinholeCamera camera = ring_of_cameras(3, 120, {0.2, 1.4, 0.1}).at(1);
  const CropBox box{13, -7, 90};
  const Camera crop = crop_camera(camera, box, 64);
  for (const Eigen::Vector3d& point : {Eigen::Vector3d(0.2, 1.0, 0.1), Eigen::Vector3d(-0.3, 1.7, 0.4)}) {
    const Eigen::Vector2d full = camera.project(point), small = crop.project(point);
    EXPECT_NEAR(small.x(), (full.x() - box.u0) * 64.0 / 90.0, 1e-9);
    EXPECT_NEAR(small.y(), (full.y() - box.v0) * 64.0 / 90.0, 1e-9);
  }
}

// An edge that lies between two pixels of the image must lie at the mapped position of the crop, whatever the scale.
TEST(CropReference, ResizedMaskKeepsItsEdges) {
  const cv::Mat mask = rectangle_mask({200, 200}, {50, 60, 80, 90});
  const CropBox box = crop_of_mask(mask, 0.1);
  for (const int pixels : {30, 64, 108, 216, 350}) {
    const cv::Mat crop = crop_mask(mask, box, pixels);
    const cv::Rect seen = cv::boundingRect(crop);
    const double scale = static_cast<double>(pixels) / box.side;
    EXPECT_NEAR(seen.x, (50 - box.u0) * scale, 0.51) << pixels;
    EXPECT_NEAR(seen.br().x, (130 - box.u0) * scale, 0.51) << pixels;
    EXPECT_NEAR(seen.y, (60 - box.v0) * scale, 0.51) << pixels;
    EXPECT_NEAR(seen.br().y, (150 - box.v0) * scale, 0.51) << pixels;
  }
}

TEST(CropReference, ABodyCutOffByTheImageGoesOnBeyondIt) {
  const cv::Mat mask = rectangle_mask({60, 200}, {20, 10, 20, 190});  // feet at the lower border
  const CropBox box = crop_of_mask(mask, 0.1);
  const cv::Mat crop = crop_mask(mask, box, box.side);
  EXPECT_EQ(crop.at<std::uint8_t>(box.side - 1, 30 - box.u0), 255);
  EXPECT_EQ(crop_image(cv::Mat(200, 60, CV_8UC3, cv::Scalar(9, 9, 9)), box, box.side).at<cv::Vec3b>(5, 0)[0], 0);
}

/// The definition, pixel by pixel.
float brute_force_distance(const cv::Mat& mask, int row, int column) {
  const bool inside = mask.at<std::uint8_t>(row, column) != 0;
  double best = 1e9;
  for (int r = 0; r < mask.rows; ++r)
    for (int c = 0; c < mask.cols; ++c)
      if ((mask.at<std::uint8_t>(r, c) != 0) != inside) best = std::min(best, std::hypot(r - row, c - column));
  return static_cast<float>(inside ? 0.5 - best : best - 0.5);
}

TEST(DistanceReference, EqualsTheDefinition) {
  cv::Mat mask = rectangle_mask({23, 31}, {4, 5, 9, 17});
  cv::circle(mask, {15, 20}, 5, 255, cv::FILLED);
  mask.at<std::uint8_t>(2, 20) = 255;
  const cv::Mat distance = signed_distance(mask);
  for (int row = 0; row < mask.rows; ++row)
    for (int column = 0; column < mask.cols; ++column)
      ASSERT_NEAR(distance.at<float>(row, column), brute_force_distance(mask, row, column), 1e-4);
}

// Sampled bilinearly the zero level must lie on the edge between the pixels.
TEST(DistanceReference, ZeroLiesOnThePixelEdge) {
  const cv::Mat distance = signed_distance(rectangle_mask({20, 20}, {8, 0, 12, 20}));
  EXPECT_FLOAT_EQ(distance.at<float>(10, 7), 0.5f);
  EXPECT_FLOAT_EQ(distance.at<float>(10, 8), -0.5f);
}

TEST(ContourReference, HoldsThePixelsAtTheEdgeAndDropsSpecks) {
  cv::Mat mask = rectangle_mask({30, 30}, {5, 6, 10, 12});
  mask.at<std::uint8_t>(25, 25) = 255;
  mask.at<std::uint8_t>(25, 26) = 255;
  const std::vector<ContourPixel> contour = contour_pixels(mask);
  EXPECT_EQ(contour.size(), 2u * 10 + 2u * 10);
  for (const ContourPixel& pixel : contour) {
    EXPECT_TRUE(pixel.x == 5 || pixel.x == 14 || pixel.y == 6 || pixel.y == 17);
    EXPECT_LT(pixel.x, 20);
  }
}

TEST(ContourReference, TheWindowsBorderIsNoContour) {
  const std::vector<ContourPixel> contour = contour_pixels(rectangle_mask({30, 30}, {10, 10, 10, 20}));
  for (const ContourPixel& pixel : contour) EXPECT_TRUE(pixel.x == 10 || pixel.x == 19 || pixel.y == 10);
}

TEST(MaskReference, ThresholdAndLargestComponent) {
  cv::Mat grey = cv::Mat::zeros(10, 10, CV_8U);
  grey(cv::Rect(1, 1, 3, 3)).setTo(128);
  grey(cv::Rect(6, 6, 2, 2)).setTo(255);
  grey.at<std::uint8_t>(0, 9) = 127;
  const cv::Mat mask = threshold_mask(grey, 128);
  EXPECT_EQ(cv::countNonZero(mask), 13);
  EXPECT_EQ(cv::countNonZero(largest_component(mask)), 9);
  EXPECT_EQ(cv::countNonZero(largest_component(cv::Mat::zeros(4, 4, CV_8U))), 0);
  EXPECT_FALSE(inspect_mask(mask).touches_border);
  EXPECT_TRUE(inspect_mask(rectangle_mask({9, 9}, {0, 3, 2, 2})).touches_border);
  EXPECT_EQ(inspect_mask(mask).area, 13);
}

double iou(const cv::Mat& a, const cv::Mat& b) {
  return static_cast<double>(cv::countNonZero(a & b)) / cv::countNonZero(a | b);
}

TEST(ChromaKeyRecovers, ThePersonFromGreenWithShadowsInBothSpaces) {
  cv::Mat studio(80, 60, CV_8UC3);
  for (int row = 0; row < studio.rows; ++row)  // uneven light
    studio.row(row).setTo(cv::Scalar(40 + row / 4, 150 + row / 2, 30 + row / 4));
  cv::Mat image = studio.clone();
  image(cv::Rect(5, 60, 50, 15)) *= 0.6;  // a shadow
  const cv::Mat ground_truth = rectangle_mask(image.size(), {20, 10, 18, 60});
  image.setTo(cv::Scalar(120, 110, 170), ground_truth);
  image(cv::Rect(20, 10, 18, 20)).setTo(cv::Scalar(20, 22, 25));  // dark hair
  cv::Mat noise(image.size(), CV_8UC3);
  cv::RNG random(3);
  random.fill(noise, cv::RNG::UNIFORM, 0, 6);
  image += noise;
  for (const auto space : {ChromaKey::Space::hsv, ChromaKey::Space::ycrcb})
    for (const bool against_background : {false, true}) {
      ChromaKey key;
      key.space = space;
      key.against_background = against_background;
      key.colour = {40, 170, 50};
      EXPECT_GT(iou(chroma_key_mask(image, key, studio), ground_truth), 0.97)
          << static_cast<int>(space) << " " << against_background;
    }
}

TEST(ChromaKeyRejects, ABackgroundOfAnotherSize) {
  ChromaKey key;
  key.against_background = true;
  EXPECT_THROW(chroma_key_mask(cv::Mat::zeros(4, 4, CV_8UC3), key, cv::Mat::zeros(4, 5, CV_8UC3)), Error);
}

}  // namespace
}  // namespace doppel::mask_test
