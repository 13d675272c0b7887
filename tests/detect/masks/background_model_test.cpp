#include "doppel/detect/masks/background_model.h"

#include <gmock/gmock.h>

#include <opencv2/imgproc.hpp>

#include "doppel/core/error.h"

namespace doppel::background_model_test {
namespace {

constexpr int kWidth = 240, kHeight = 320;
const cv::Scalar kShirt(60, 40, 150), kTrousers(120, 60, 30);

/// A wall with blurred tiles over a plain floor.
cv::Mat scenery() {
  cv::Mat image(kHeight, kWidth, CV_8UC3, cv::Scalar(110, 135, 150));
  for (int row = 0; row < 220; row += 22)
    for (int column = 0; column < kWidth; column += 40)
      cv::rectangle(image, cv::Rect(column + row % 3 * 7, row, 36, 18), cv::Scalar(80, 100 + row / 4, 160), -1);
  cv::rectangle(image, cv::Rect(0, 220, kWidth, 100), cv::Scalar(140, 150, 155), -1);
  cv::GaussianBlur(image, image, {}, 2.0);
  return image;
}

cv::Rect head(int at) { return {at + 12, 60, 26, 34}; }
cv::Rect body(int at) { return {at, 94, 50, 86}; }
cv::Rect legs(int at) { return {at + 6, 180, 38, 100}; }

cv::Mat ground_truth(int at) {
  cv::Mat mask = cv::Mat::zeros(kHeight, kWidth, CV_8U);
  for (const cv::Rect& part : {head(at), body(at), legs(at)}) cv::rectangle(mask, part, 255, -1);
  return mask;
}

void draw_person(cv::Mat& image, int at) {
  cv::rectangle(image, head(at), cv::Scalar(90, 120, 190), -1);
  cv::rectangle(image, body(at), kShirt, -1);
  cv::rectangle(image, legs(at), kTrousers, -1);
  for (int i = 0; i < 5; ++i) cv::circle(image, {at + 8 + 8 * i, 120 + 9 * i}, 3, cv::Scalar(200, 190, 70), -1);
}

/// What a sensor adds, under another exposure.
cv::Mat filmed(const cv::Mat& scene, std::uint64_t seed, const cv::Scalar& exposure = cv::Scalar::all(1)) {
  cv::Mat noise(scene.size(), CV_32FC3), image;
  cv::RNG(seed).fill(noise, cv::RNG::NORMAL, 0, 2);
  scene.convertTo(image, CV_32FC3);
  cv::multiply(image, exposure, image);
  image += noise;
  image.convertTo(image, CV_8UC3);
  return image;
}

cv::Mat with_person(int at, std::uint64_t seed, const cv::Scalar& exposure = cv::Scalar::all(1)) {
  cv::Mat scene = scenery();
  draw_person(scene, at);
  return filmed(scene, seed, exposure);
}

double overlap(const cv::Mat& a, const cv::Mat& b) {
  return static_cast<double>(cv::countNonZero(a & b)) / cv::countNonZero(a | b);
}

BackgroundModel model_of(bool refine, int images = 20) {
  BackgroundOptions options;
  options.refine = refine;
  BackgroundModel model(options);
  for (int i = 0; i < images; ++i) model.learn(filmed(scenery(), 100 + i));
  return model;
}

class BackgroundSubtraction : public ::testing::TestWithParam<bool> {};

TEST_P(BackgroundSubtraction, CutsThePersonOut) {
  for (const int images : {1, 5, 60}) {
    BackgroundModel model = model_of(GetParam(), images);
    for (const int at : {5, 90, 180})
      EXPECT_GT(overlap(model.mask(with_person(at, 7)), ground_truth(at)), 0.97) << images;
    EXPECT_EQ(cv::countNonZero(model.mask(filmed(scenery(), 8))), 0) << "nobody is there";
  }
}

TEST_P(BackgroundSubtraction, TakesAShadowForBackground) {
  cv::Mat scene = scenery();
  const std::vector<cv::Point> shadow{{120, 278}, {200, 240}, {215, 250}, {140, 290}};
  cv::Mat dark = scene * 0.62, where = cv::Mat::zeros(scene.size(), CV_8U);
  cv::fillConvexPoly(where, shadow, 255);
  dark.copyTo(scene, where);
  draw_person(scene, 80);
  BackgroundModel model = model_of(GetParam());
  EXPECT_GT(overlap(model.mask(filmed(scene, 7)), ground_truth(80)), 0.96);
  BackgroundOptions taken;
  taken.refine = false;
  taken.shadow = 1.0;
  BackgroundModel other(taken);
  for (int i = 0; i < 20; ++i) other.learn(filmed(scenery(), 100 + i));
  EXPECT_LT(overlap(other.mask(filmed(scene, 7)), ground_truth(80)), 0.92) << "the shadow of the test is none";
}

// A stripe and a button have the colour of the wall behind them: the person is not cut in two, and has no hole.
TEST_P(BackgroundSubtraction, KeepsWhatHasTheColourOfTheBackground) {
  cv::Mat scene = scenery();
  draw_person(scene, 90);
  const cv::Rect stripe(90, 125, 50, 2), button(100, 150, 4, 4);
  for (const cv::Rect& part : {stripe, button}) scenery()(part).copyTo(scene(part));
  BackgroundModel model = model_of(GetParam());
  const cv::Mat mask = model.mask(filmed(scene, 7));
  EXPECT_GT(overlap(mask, ground_truth(90)), 0.97);
  for (const cv::Rect& part : {stripe, button}) EXPECT_LT(cv::countNonZero(~mask(part)), 0.15 * part.area());
}

TEST_P(BackgroundSubtraction, SeesThroughTheGapBetweenArmAndBody) {
  cv::Mat scene = scenery();
  draw_person(scene, 90);
  const cv::Rect gap(104, 110, 20, 50);
  scenery()(gap).copyTo(scene(gap));
  const cv::Mat mask = model_of(GetParam()).mask(filmed(scene, 7));
  EXPECT_LT(cv::countNonZero(mask(gap)), 0.15 * gap.area());
}

TEST_P(BackgroundSubtraction, FollowsASlowChangeOfTheLight) {
  BackgroundModel model = model_of(GetParam());
  for (int frame = 0; frame <= 10; ++frame) {
    const double k = frame / 10.0;  // darker and warmer, as when a cloud passes
    const cv::Scalar exposure(1.0 - 0.2 * k, 1.0 - 0.14 * k, 1.0 - 0.08 * k);
    EXPECT_GT(overlap(model.mask(with_person(60 + 8 * frame, 30 + frame, exposure)), ground_truth(60 + 8 * frame)),
              0.96)
        << k;
    EXPECT_EQ(cv::countNonZero(model.mask(filmed(scenery(), 50 + frame, exposure))), 0) << k;
  }
  EXPECT_GT(overlap(model.mask(with_person(60, 3, cv::Scalar::all(1.12))), ground_truth(60)), 0.96) << "brighter";
}

// More than half of the image is covered, and the exposure changed.
TEST_P(BackgroundSubtraction, APersonNearTheCamera) {
  cv::Mat scene = scenery(), mask = cv::Mat::zeros(scene.size(), CV_8U);
  for (int row = 40; row < kHeight; ++row) {
    cv::rectangle(mask, cv::Rect(40, row, 160, 1), 255, -1);
    cv::rectangle(scene, cv::Rect(40, row, 160, 1), cv::Scalar(40 + row / 3, 60, 200 - row / 2), -1);
  }
  ASSERT_GT(cv::countNonZero(mask), 0.5 * mask.total());
  EXPECT_GT(overlap(model_of(GetParam()).mask(filmed(scene, 7, cv::Scalar::all(0.9))), mask), 0.95);
}

TEST_P(BackgroundSubtraction, LearnsNothingFromWhatItCuts) {
  BackgroundModel model = model_of(GetParam());
  const cv::Mat image = with_person(60, 7), before = model.mask(image);
  for (int i = 0; i < 60; ++i) model.mask(with_person(60, 500 + i));
  EXPECT_EQ(cv::countNonZero(model.mask(image) != before), 0);
  EXPECT_EQ(cv::countNonZero(model_of(GetParam()).mask(image) != before), 0) << "another model of the same images";
  cv::theRNG().state = 12345;
  EXPECT_EQ(cv::countNonZero(model.mask(image) != before), 0);
  EXPECT_EQ(cv::theRNG().state, 12345u) << "other users of the generator must not notice";
}

TEST_P(BackgroundSubtraction, SurvivesImagesOfNothing) {
  BackgroundModel model = model_of(GetParam());
  for (const int level : {0, 128, 255}) {
    const cv::Mat mask = model.mask(cv::Mat(kHeight, kWidth, CV_8UC3, cv::Scalar::all(level)));
    EXPECT_EQ(mask.size(), cv::Size(kWidth, kHeight));
    EXPECT_EQ(cv::countNonZero(mask) + cv::countNonZero(mask == 0), kWidth * kHeight);
  }
  BackgroundModel small{BackgroundOptions()};
  small.learn(cv::Mat::zeros(2, 1, CV_8UC3));
  EXPECT_NO_THROW(small.mask(cv::Mat(2, 1, CV_8UC3, cv::Scalar::all(200))));
}

INSTANTIATE_TEST_SUITE_P(RefinedOrNot, BackgroundSubtraction, ::testing::Bool());

TEST(BackgroundSubtractionRejects, WhatCannotBe) {
  BackgroundModel model;
  EXPECT_THROW(model.mask(with_person(60, 7)), UsageError);
  model.learn(filmed(scenery(), 1));
  EXPECT_THROW(model.learn(cv::Mat::zeros(10, 10, CV_8UC3)), Error);
  EXPECT_THROW(model.mask(cv::Mat::zeros(kHeight, kWidth, CV_8U)), Error);
  model.mask(with_person(60, 7));
  EXPECT_THROW(model.learn(filmed(scenery(), 2)), UsageError);
  for (const double bad : {0.0, -1.0, 1.5}) {
    BackgroundOptions options;
    options.shadow = bad;
    EXPECT_THROW(BackgroundModel{options}, UsageError);
  }
  BackgroundOptions options;
  options.threshold = 0.0;
  EXPECT_THROW(BackgroundModel{options}, UsageError);
}

}  // namespace
}  // namespace doppel::background_model_test
