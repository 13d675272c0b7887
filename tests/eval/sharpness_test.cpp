#include "doppel/eval/sharpness.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

namespace doppel::sharpness_test {
namespace {

/// A wave along both axes' diagonal. @param frequency cycles per pixel
cv::Mat wave(double frequency, double amplitude) {
  cv::Mat image(128, 128, CV_8UC3);
  for (int y = 0; y < image.rows; ++y)
    for (int x = 0; x < image.cols; ++x) {
      const double phase = 2.0 * CV_PI * frequency * (0.6 * x + 0.8 * y);
      image.at<cv::Vec3b>(y, x) = cv::Vec3b::all(cv::saturate_cast<std::uint8_t>(128.0 + amplitude * std::sin(phase)));
    }
  return image;
}

cv::Mat disc() {
  cv::Mat region = cv::Mat::zeros(128, 128, CV_8U);
  cv::circle(region, {64, 64}, 50, 255, cv::FILLED);
  return region;
}

TEST(DetailEnergyReference, AWaveCountsByTheSquareOfItsAmplitude) {
  // The mean square of a sine is half of its amplitude's square.
  EXPECT_NEAR(detail_energy(wave(0.35, 80), disc()), 0.5 * 80 * 80, 0.02 * 80 * 80);
  EXPECT_NEAR(detail_energy(wave(0.35, 40), disc()) / detail_energy(wave(0.35, 80), disc()), 0.25, 0.005);
}

TEST(DetailEnergyReference, HalfPassesAtTheLimitAndLittleFarBelow) {
  const double all = 0.5 * 80 * 80;
  EXPECT_NEAR(detail_energy(wave(kDetailFrequency, 80), disc()) / all, 0.5, 0.03);
  EXPECT_LT(detail_energy(wave(kDetailFrequency / 4.0, 80), disc()) / all, 0.01);
}

TEST(DetailEnergyReference, TheOutlineOfTheRegionIsNoDetail) {
  cv::Mat person(128, 128, CV_8UC3, cv::Scalar::all(200));
  person.setTo(cv::Scalar::all(10), disc() == 0);
  EXPECT_LT(detail_energy(person, disc()), 0.01);
  EXPECT_GT(detail_energy(person, cv::Mat(128, 128, CV_8U, cv::Scalar(255))), 10.0);
}

TEST(DetailEnergyReference, AnEmptyRegionHasNone) {
  EXPECT_EQ(detail_energy(wave(0.3, 50), cv::Mat::zeros(128, 128, CV_8U)), 0.0);
}

}  // namespace
}  // namespace doppel::sharpness_test
