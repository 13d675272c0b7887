#include "doppel/detect/blazepose/mask_sharpening.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "doppel/core/error.h"
#include "doppel/detect/blazepose/repeated_chroma.h"

namespace doppel::mask_sharpening_test {
namespace {

constexpr int kWidth = 300, kHeight = 400;
constexpr int kOversampling = 4;

/// A person's outline, drawn at a higher resolution. @return coverage of each pixel, float
cv::Mat coverage(int at) {
  cv::Mat fine = cv::Mat::zeros(kHeight * kOversampling, kWidth * kOversampling, CV_8U);
  const auto point = [&](int x, int y) { return cv::Point((at + x) * kOversampling, y * kOversampling); };
  const auto limb = [&](cv::Point a, cv::Point b, int width) {
    cv::line(fine, a, b, 255, width * kOversampling, cv::LINE_8);
  };
  cv::ellipse(fine, point(0, 70), {18 * kOversampling, 24 * kOversampling}, 0, 0, 360, 255, -1);
  limb(point(0, 115), point(0, 190), 56);
  limb(point(-30, 105), point(-55, 190), 14);
  limb(point(30, 105), point(70, 160), 14);
  limb(point(-14, 200), point(-24, 340), 24);
  limb(point(14, 200), point(30, 340), 24);
  cv::Mat result;
  cv::resize(fine, result, {kWidth, kHeight}, 0, 0, cv::INTER_AREA);
  result.convertTo(result, CV_32F, 1.0 / 255.0);
  return result;
}

cv::Mat textured(std::uint64_t seed, const cv::Scalar& mean, double contrast) {
  cv::Mat noise(kHeight, kWidth, CV_32FC3);
  cv::RNG(seed).fill(noise, cv::RNG::NORMAL, 0, 1);
  cv::GaussianBlur(noise, noise, {}, 4);
  return noise * (contrast * 14.0) + mean;  // a blurred texture has a fourteenth of the contrast
}

/// A person over a textured wall, with a soft shadow beside the legs, under noise.
cv::Mat filmed(const cv::Mat& person, int at, std::uint64_t seed) {
  cv::Mat scene = textured(1, {90, 140, 110}, 12), body = textured(2, {160, 130, 200}, 10);
  cv::Mat shadow(kHeight, kWidth, CV_32F, cv::Scalar(1)), noise(kHeight, kWidth, CV_32FC3), image;
  cv::ellipse(shadow, {at + 30, 345}, {70, 25}, 0, 0, 360, 0.6, -1);
  cv::GaussianBlur(shadow, shadow, {}, 6);
  cv::RNG(seed).fill(noise, cv::RNG::NORMAL, 0, 2);
  for (int row = 0; row < kHeight; ++row)
    for (int column = 0; column < kWidth; ++column) {
      const float a = person.at<float>(row, column);
      cv::Vec3f& pixel = scene.at<cv::Vec3f>(row, column);
      pixel = pixel * (shadow.at<float>(row, column) * (1 - a)) + body.at<cv::Vec3f>(row, column) * a;
    }
  scene += noise;
  scene.convertTo(image, CV_8UC3);
  return image;
}

/// What a network of low resolution says: its outline is blurred, and two pixels too far to the right.
cv::Mat network_mask(const cv::Mat& person) {
  cv::Mat small, moved, result;
  cv::warpAffine(person, moved, cv::Matx23d(1, 0, 2, 0, 1, 0), person.size());
  cv::resize(moved, small, {kWidth / 4, kHeight / 4}, 0, 0, cv::INTER_AREA);
  cv::resize(small, result, person.size(), 0, 0, cv::INTER_LINEAR);
  result.convertTo(result, CV_8U, 255.0);
  return result;
}

struct Clip {
  std::vector<cv::Mat> images, masks, ground_truth;
};

/// A person who walks from left to right.
Clip walk(int frames, int step) {
  Clip clip;
  for (int i = 0; i < frames; ++i) {
    const int at = 80 + step * i;
    const cv::Mat person = coverage(at);
    clip.images.push_back(filmed(person, at, 100 + static_cast<std::uint64_t>(i)));
    clip.masks.push_back(network_mask(person));
    clip.ground_truth.push_back(person > 0.5);
  }
  return clip;
}

double overlap(const cv::Mat& a, const cv::Mat& b) {
  return static_cast<double>(cv::countNonZero(a & b)) / cv::countNonZero(a | b);
}

TEST(MaskSharpening, MasksAreExactOverALearntBackground) {
  const Clip clip = walk(12, 13);
  const StaticBackground background = learn_background(clip.images, clip.masks);
  EXPECT_GT(background.known_share(),
            0.9);  // the shadow moves with the person, so that samples near the floor disagree
  for (const std::size_t i : {1, 6, 11}) {
    const cv::Mat mask = sharpen_mask(clip.images[i], clip.masks[i], background);
    EXPECT_LT(overlap(clip.masks[i] >= 128, clip.ground_truth[i]), 0.95);  // otherwise nothing is tested
    EXPECT_GT(overlap(mask, clip.ground_truth[i]), 0.985) << i;
  }
}

/// The gap between the legs has the probability `value`, and is wider than the network's outline may be wrong.
TEST(MaskSharpening, AGapOpensWhereTheNetworkIsUnsure) {
  const Clip clip = walk(12, 13);
  const StaticBackground background = learn_background(clip.images, clip.masks);
  const int frame = 6, at = 80 + 13 * frame;
  const auto gain = [&](int value) {
    cv::Mat gap = cv::Mat::zeros(kHeight, kWidth, CV_8U), mask;
    const std::vector<cv::Point> between{{at - 14, 215}, {at + 14, 215}, {at + 30, 335}, {at - 24, 335}};
    cv::fillConvexPoly(gap, between, value);
    cv::max(clip.masks[frame], gap, mask);
    return overlap(sharpen_mask(clip.images[frame], mask, background), clip.ground_truth[frame]) -
           overlap(mask >= 128, clip.ground_truth[frame]);
  };
  EXPECT_GT(gain(160), 0.1);
  EXPECT_LT(gain(250), 0.09);  // the network is sure
}

TEST(MaskSharpening, MasksGainWithoutABackground) {
  const Clip clip = walk(1, 0);
  EXPECT_GT(overlap(sharpen_mask(clip.images[0], clip.masks[0]), clip.ground_truth[0]), 0.97);
}

TEST(MaskSharpening, TheSameInputGivesTheSameMask) {
  const Clip clip = walk(6, 26);
  const StaticBackground first = learn_background(clip.images, clip.masks);
  const StaticBackground second = learn_background(clip.images, clip.masks);
  const cv::Mat a = sharpen_mask(clip.images[2], clip.masks[2], first);
  const cv::Mat b = sharpen_mask(clip.images[2], clip.masks[2], second);
  EXPECT_EQ(cv::countNonZero(a != b), 0);
}

TEST(MaskSharpening, AnEmptyMaskStaysEmpty) {
  const cv::Mat image(40, 50, CV_8UC3, cv::Scalar(10, 20, 30));
  const cv::Mat mask = sharpen_mask(image, cv::Mat::zeros(40, 50, CV_8U));
  EXPECT_EQ(mask.size(), image.size());
  EXPECT_EQ(cv::countNonZero(mask), 0);
}

TEST(MaskSharpening, AFullMaskStaysFull) {
  const cv::Mat image(40, 50, CV_8UC3, cv::Scalar(10, 20, 30));
  EXPECT_EQ(cv::countNonZero(sharpen_mask(image, cv::Mat(40, 50, CV_8U, cv::Scalar(255)))), 40 * 50);
}

TEST(MaskSharpening, ABackgroundOfAnotherSizeIsNotUsed) {
  const Clip clip = walk(1, 0);
  const StaticBackground other{cv::Mat::zeros(7, 9, CV_8UC3), cv::Mat(7, 9, CV_8U, cv::Scalar(255))};
  const cv::Mat with = sharpen_mask(clip.images[0], clip.masks[0], other);
  EXPECT_EQ(cv::countNonZero(with != sharpen_mask(clip.images[0], clip.masks[0])), 0);
}

TEST(MaskSharpening, WrongInputIsRefused) {
  const cv::Mat image(40, 50, CV_8UC3), grey(40, 50, CV_8U);
  EXPECT_THROW(sharpen_mask(grey, grey), UsageError);
  EXPECT_THROW(sharpen_mask(image, image), UsageError);
  EXPECT_THROW(sharpen_mask(image, cv::Mat(40, 51, CV_8U)), UsageError);
  EXPECT_THROW(sharpen_mask({}, {}), UsageError);
  EXPECT_THROW(learn_background({image}, {}), UsageError);
  EXPECT_THROW(learn_background({image}, {image}), UsageError);
}

TEST(StaticBackground, OneFrameTeachesNothing) {
  const Clip clip = walk(1, 0);
  EXPECT_EQ(learn_background(clip.images, clip.masks).known_share(), 0);
  EXPECT_EQ(learn_background({}, {}).known_share(), 0);
}

TEST(StaticBackground, PixelsBehindAStandingPersonStayUnknown) {
  const Clip clip = walk(8, 0);
  const StaticBackground background = learn_background(clip.images, clip.masks);
  EXPECT_EQ(cv::countNonZero(background.known & clip.ground_truth[0]), 0);
  EXPECT_GT(background.known_share(), 0.6);
}

TEST(StaticBackground, AMovingCameraHasNone) {
  Clip clip = walk(8, 13);
  for (int i = 0; i < 8; ++i)
    for (cv::Mat* image : {&clip.images[static_cast<std::size_t>(i)], &clip.masks[static_cast<std::size_t>(i)]})
      cv::warpAffine(image->clone(), *image, cv::Matx23d(1, 0, 9 * i, 0, 1, -7 * i), image->size(), cv::INTER_LINEAR,
                     cv::BORDER_REFLECT);
  EXPECT_EQ(learn_background(clip.images, clip.masks).known_share(), 0);
}

TEST(StaticBackground, ImagesOfAnotherSizeAreLeftOut) {
  Clip clip = walk(7, 20);
  const double before = learn_background(clip.images, clip.masks).known_share();
  clip.images.push_back(cv::Mat::zeros(20, 20, CV_8UC3));
  clip.masks.push_back(cv::Mat::zeros(20, 20, CV_8U));
  EXPECT_EQ(learn_background(clip.images, clip.masks).known_share(), before);
}

TEST(StaticBackground, FramesAreSpreadAndBounded) {
  std::vector<long> frames;
  for (long frame = 10; frame < 1010; ++frame) frames.push_back(frame);
  const std::vector<long> small = background_frames(frames, {640, 480});
  EXPECT_EQ(small.size(), 41u);
  EXPECT_EQ(small.front(), 10);
  EXPECT_EQ(small.back(), 1009);
  const std::vector<long> large = background_frames(frames, {3840, 2160});
  EXPECT_GE(large.size(), 7u);
  EXPECT_LE(large.size() * 3840.0 * 2160 * 4, 256.0 * 1024 * 1024);
  EXPECT_EQ(background_frames({3, 4}, {640, 480}).size(), 2u);
}

TEST(SmoothRepeatedChroma, OnlyRepeatedChromaChanges) {
  cv::Mat image;
  textured(3, {120, 120, 120}, 30).convertTo(image, CV_8UC3);
  EXPECT_EQ(cv::norm(smooth_repeated_chroma(image), image, cv::NORM_INF), 0);
  cv::Mat converted, half, repeated;
  cv::cvtColor(image, converted, cv::COLOR_BGR2YCrCb);
  std::vector<cv::Mat> channels;
  cv::split(converted, channels);
  for (const std::size_t k : {1, 2}) {
    cv::resize(channels[k], half, {}, 0.5, 0.5, cv::INTER_AREA);
    cv::resize(half, channels[k], image.size(), 0, 0, cv::INTER_NEAREST);
  }
  cv::merge(channels, converted);
  cv::cvtColor(converted, repeated, cv::COLOR_YCrCb2BGR);
  EXPECT_LT(cv::norm(smooth_repeated_chroma(repeated), image, cv::NORM_L1),
            0.7 * cv::norm(repeated, image, cv::NORM_L1));
}

}  // namespace
}  // namespace doppel::mask_sharpening_test
