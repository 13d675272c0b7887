#include "doppel/detect/networks/network_view.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "detect/networks/small_networks.h"

namespace doppel::network_view_test {
namespace {

using namespace test_networks;
using Vec = Eigen::Vector2d;

/// Blue grows with x, green with y: 2 by pixel, from 1 at the first centre.
cv::Mat ramp(int width, int height) {
  cv::Mat image(height, width, CV_8UC3);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      image.at<cv::Vec3b>(y, x) = cv::Vec3b(std::uint8_t(1 + 2 * x), std::uint8_t(1 + 2 * y), 7);
  return image;
}

NetworkOptions colours_as_they_are() {
  NetworkOptions options;
  options.deviation.fill(1.0);
  return options;
}

float at(const cv::Mat& input, int channel, int x, int y) {
  return input.ptr<float>(0, channel)[y * input.size[3] + x];
}

TEST(NetworkView, ColoursBecomeValuesWithMeanAndDeviationOfEachChannel) {
  cv::Mat image(2, 2, CV_8UC3, cv::Scalar(10, 20, 30));
  image.at<cv::Vec3b>(1, 0) = {110, 120, 130};
  NetworkOptions options;
  options.input = {2, 2};
  options.mean = {1.0, 2.0, 3.0};
  options.deviation = {2.0, 4.0, 8.0};
  const NetworkView view = whole_view(options, image.size());
  const cv::Mat bgr = network_input(image, view, options);
  ASSERT_EQ(bgr.dims, 4);
  EXPECT_FLOAT_EQ(at(bgr, 0, 0, 0), (10 - 1) / 2.0f);
  EXPECT_FLOAT_EQ(at(bgr, 1, 1, 1), (20 - 2) / 4.0f);
  EXPECT_FLOAT_EQ(at(bgr, 2, 0, 1), (130 - 3) / 8.0f);
  options.rgb = true;
  const cv::Mat rgb = network_input(image, view, options);
  EXPECT_FLOAT_EQ(at(rgb, 0, 0, 1), (130 - 1) / 2.0f);
  EXPECT_FLOAT_EQ(at(rgb, 2, 0, 1), (110 - 3) / 8.0f);
}

TEST(NetworkView, CropsShowThePixelsThatTheyClaim) {
  const cv::Mat image = ramp(100, 80);
  // Smaller and larger steps than a pixel, and several pixels for one.
  for (const double side : {9.0, 30.0, 41.3, 70.0}) {
    const PersonBox box{Vec(50.3 - 0.3 * side, 39.6 - 0.5 * side), Vec(50.3 + 0.3 * side, 39.6 + 0.5 * side)};
    const cv::Size input(12, 16);
    const NetworkView view = crop_view(box, 1.0, input);
    EXPECT_DOUBLE_EQ(view.step.x(), view.step.y());
    const cv::Mat values = network_input(image, view, colours_as_they_are());
    Vec error = Vec::Zero();
    int count = 0;
    for (int y = 0; y < input.height; ++y)
      for (int x = 0; x < input.width; ++x) {
        const Vec position = view.image_from_input({x + 0.5, y + 0.5});
        if ((position.array() < 3).any() || position.x() > 97 || position.y() > 77) continue;
        // Colours are rounded after the average and after the interpolation.
        EXPECT_NEAR(at(values, 0, x, y), 2.0 * position.x(), 1.1) << side;
        EXPECT_NEAR(at(values, 1, x, y), 2.0 * position.y(), 1.1) << side;
        error += Vec(at(values, 0, x, y) - 2.0 * position.x(), at(values, 1, x, y) - 2.0 * position.y());
        ++count;
      }
    ASSERT_GT(count, 50);
    // The ramp is 2 by pixel: on average 0.1 pixel, of the coarser one of image and input.
    EXPECT_LT((error / count).cwiseAbs().maxCoeff(), 0.2 * std::max(1.0, view.step.x())) << side;
  }
}

TEST(NetworkView, CropsKeepTheAspectOfTheInputAndArePadded) {
  const NetworkView view = crop_view({Vec(10, 20), Vec(30, 80)}, 1.25, {48, 64});
  // Height decides: 60 * 1.25 = 75 pixels on 64.
  EXPECT_DOUBLE_EQ(view.step.y(), 75.0 / 64.0);
  EXPECT_TRUE(view.image_from_input({24, 32}).isApprox(Vec(20, 50)));
  EXPECT_TRUE(view.image_from_input({0, 0}).isApprox(Vec(20 - 0.5 * 75.0 * 48 / 64, 50 - 37.5)));
}

TEST(NetworkView, BeyondTheImageIsTheBorder) {
  NetworkOptions options = colours_as_they_are();
  options.border = 114.0;
  options.letterbox = true;
  options.input = {32, 32};
  const cv::Mat image(16, 64, CV_8UC3, cv::Scalar::all(40));
  const NetworkView view = whole_view(options, image.size());
  const cv::Mat values = network_input(image, view, options);
  EXPECT_FLOAT_EQ(at(values, 1, 16, 0), 114.0f);
  EXPECT_FLOAT_EQ(at(values, 1, 16, 10), 114.0f);
  EXPECT_FLOAT_EQ(at(values, 1, 16, 16), 40.0f);
  EXPECT_FLOAT_EQ(at(values, 1, 16, 30), 114.0f);
  const NetworkView far = crop_view({Vec(500, 500), Vec(520, 520)}, 1.0, {8, 8});
  EXPECT_FLOAT_EQ(at(network_input(image, far, options), 0, 3, 3), 114.0f);
}

TEST(NetworkView, MasksComeBackToTheirPixels) {
  // A mask with an edge in the middle of the crop, at another size than the network's input.
  const NetworkView view = crop_view({Vec(20, 10), Vec(60, 50)}, 1.0, {64, 64});
  cv::Mat probability = cv::Mat::zeros(16, 16, CV_32F);
  probability(cv::Rect(8, 0, 8, 16)) = 1.0f;
  const cv::Mat mask = image_mask(probability, view, {100, 80});
  ASSERT_EQ(mask.size(), cv::Size(100, 80));
  EXPECT_EQ(mask.at<std::uint8_t>(30, 19), 0) << "outside of the crop";
  EXPECT_EQ(mask.at<std::uint8_t>(30, 30), 0);
  EXPECT_EQ(mask.at<std::uint8_t>(30, 59), 255);
  EXPECT_EQ(mask.at<std::uint8_t>(30, 60), 0) << "outside of the crop";
  EXPECT_EQ(mask.at<std::uint8_t>(9, 50), 0);
  EXPECT_EQ(mask.at<std::uint8_t>(10, 50), 255);
  // Linear across the edge at x = 40: the entries' centres are at 38.75 and 41.25. OpenCV rounds to 1/32 entry.
  EXPECT_NEAR(mask.at<std::uint8_t>(30, 39), 255.0 * (39.5 - 38.75) / 2.5, 255.0 / 32);
  EXPECT_NEAR(mask.at<std::uint8_t>(30, 40), 255.0 * (40.5 - 38.75) / 2.5, 255.0 / 32);
}

}  // namespace
}  // namespace doppel::network_view_test
