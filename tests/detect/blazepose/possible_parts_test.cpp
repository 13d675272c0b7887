#include "doppel/detect/blazepose/possible_parts.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "doppel/core/error.h"

namespace doppel::possible_parts_test {
namespace {

constexpr int kSide = 400;
const cv::Rect kTrunk(180, 60, 60, 300);     // that the network found; a cell has 1.5 pixels
const cv::Rect kArm(240, 120, 80, 16);       // that it missed
const cv::Rect kShadow(150, 340, 30, 40);    // beside the trunk
const cv::Rect kSomebody(20, 100, 40, 120);  // does not touch the trunk
const cv::Rect kBlur(178, 100, 2, 200);      // along the outline

/// A person before a wall with noise.
struct Scene {
  Scene() {
    cv::Mat noise(kSide, kSide, CV_32FC3);
    cv::RNG(3).fill(noise, cv::RNG::NORMAL, 110, 20);
    noise.convertTo(background.colour, CV_8UC3);
    background.known = cv::Mat(kSide, kSide, CV_8U, cv::Scalar(255));
    image = background.colour.clone();
    const cv::Scalar skin(120, 150, 220);
    for (const cv::Rect& part : {kTrunk, kArm, kSomebody, kBlur}) image(part).setTo(skin);
    cv::Mat(0.7 * background.colour(kShadow)).copyTo(image(kShadow));
    mask = cv::Mat::zeros(kSide, kSide, CV_8U);
    mask(kTrunk).setTo(255);
  }
  cv::Mat image, mask;
  StaticBackground background;
};

TEST(PossibleParts, AnArmBesideTheTrunkIsMarked) {
  Scene scene;
  mark_possible_parts(scene.image, scene.mask, scene.background);
  cv::Mat expected = cv::Mat::zeros(kSide, kSide, CV_8U);
  expected(kTrunk).setTo(255);
  expected(kArm).setTo(kPossiblePerson);
  EXPECT_EQ(cv::countNonZero(scene.mask != expected), 0);
}

TEST(PossibleParts, NothingIsMarkedWhereTheBackgroundIsNotKnown) {
  Scene scene;
  const cv::Mat before = scene.mask.clone();
  mark_possible_parts(scene.image, scene.mask, {});
  scene.background.known(kArm).setTo(0);
  mark_possible_parts(scene.image, scene.mask, scene.background);
  EXPECT_EQ(cv::countNonZero(scene.mask != before), 0);
}

TEST(PossibleParts, AnEmptyMaskStaysEmpty) {
  Scene scene;
  scene.mask.setTo(0);
  mark_possible_parts(scene.image, scene.mask, scene.background);
  EXPECT_EQ(cv::countNonZero(scene.mask), 0);
}

TEST(PossibleParts, AMaskOfAnotherSizeIsRefused) {
  Scene scene;
  cv::Mat small = cv::Mat::zeros(5, 5, CV_8U);
  EXPECT_THROW(mark_possible_parts(scene.image, small, scene.background), UsageError);
}

}  // namespace
}  // namespace doppel::possible_parts_test
