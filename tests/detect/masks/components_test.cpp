#include "doppel/detect/masks/components.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <vector>

namespace doppel::components_test {
namespace {

cv::Mat rectangles(const std::vector<cv::Rect>& parts) {
  cv::Mat mask = cv::Mat::zeros(60, 80, CV_8U);
  for (const cv::Rect& part : parts) mask(part).setTo(255);
  return mask;
}

bool equal(const cv::Mat& a, const cv::Mat& b) { return cv::countNonZero(a != b) == 0; }

TEST(LargestComponent, HasMoreThanHalfOfThePixels) {
  const cv::Rect person(30, 5, 20, 50);
  EXPECT_TRUE(equal(largest_component(rectangles({person, {2, 2, 5, 5}, {70, 50, 6, 6}})), rectangles({person})));
}

TEST(LargestComponent, LiesAwayFromTheMiddle) {
  const cv::Rect person(2, 2, 20, 20);
  EXPECT_TRUE(equal(largest_component(rectangles({{38, 28, 4, 4}, person})), rectangles({person})));
}

TEST(LargestComponent, HasLessThanHalfOfThePixels) {
  const std::vector<cv::Rect> parts{{0, 0, 10, 10}, {20, 0, 10, 11}, {40, 0, 10, 10}, {20, 28, 10, 9}};
  EXPECT_TRUE(equal(largest_component(rectangles(parts)), rectangles({parts[1]})));
}

TEST(LargestComponent, ContinuesOverCorners) {
  const std::vector<cv::Rect> parts{{10, 10, 10, 10}, {20, 20, 10, 10}};
  EXPECT_TRUE(equal(largest_component(rectangles(parts)), rectangles(parts)));
}

TEST(ComponentsTouching, HaveAPixelOnTheOtherMask) {
  const std::vector<cv::Rect> parts{{10, 10, 10, 10}, {20, 20, 10, 10}, {50, 10, 10, 10}, {50, 40, 5, 5}};
  const cv::Mat found = components_touching(rectangles(parts), rectangles({{0, 0, 11, 11}, {48, 43, 3, 10}}));
  EXPECT_TRUE(equal(found, rectangles({parts[0], parts[1], parts[3]}))) << "the first two meet at a corner";
  EXPECT_EQ(cv::countNonZero(components_touching(rectangles(parts), rectangles({{30, 0, 10, 10}}))), 0);
}

TEST(LargestComponent, IsEmptyInAnEmptyMask) { EXPECT_EQ(cv::countNonZero(largest_component(rectangles({}))), 0); }

TEST(FillHoles, FillsThoseUpToTheLimit) {
  const cv::Rect person(10, 5, 60, 50);
  cv::Mat mask = rectangles({person});
  mask(cv::Rect(20, 20, 3, 3)).setTo(0);
  mask(cv::Rect(40, 20, 4, 4)).setTo(0);
  cv::Mat expected = rectangles({person});
  expected(cv::Rect(40, 20, 4, 4)).setTo(0);
  fill_holes(mask, 9);
  EXPECT_TRUE(equal(mask, expected));
}

TEST(FillHoles, HolesThatTouchAtACornerAreTwo) {
  cv::Mat mask = rectangles({{10, 5, 60, 50}});
  mask(cv::Rect(20, 20, 3, 3)).setTo(0);
  mask(cv::Rect(23, 23, 3, 3)).setTo(0);
  fill_holes(mask, 9);
  EXPECT_TRUE(equal(mask, rectangles({{10, 5, 60, 50}})));
}

TEST(FillHoles, ACornerThatTheMaskCutsOffIsAHoleToo) {
  cv::Mat mask = rectangles({{0, 2, 80, 50}, {2, 0, 78, 50}});
  fill_holes(mask, 4);
  EXPECT_TRUE(equal(mask, rectangles({{0, 0, 80, 52}})));
}

TEST(FillHoles, KeepsAMaskThatCoversTheImage) {
  cv::Mat mask = cv::Mat(60, 80, CV_8U, cv::Scalar(255));
  fill_holes(mask, 9);
  EXPECT_EQ(cv::countNonZero(mask), 60 * 80);
}

}  // namespace
}  // namespace doppel::components_test
