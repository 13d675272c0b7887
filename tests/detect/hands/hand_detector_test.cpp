#include "doppel/detect/hands/hand_detector.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "detect/blazepose/small_model.h"
#include "detect/blazepose/small_network.h"
#include "doppel/core/error.h"
#include "support/message_of.h"

namespace doppel::hand_detector_test {
namespace {

using support::image_of;
using support::network_of;
using support::SmallModel;
using Op = tflite::BuiltinOperator;
using ::testing::HasSubstr;

/// A network with the inputs and outputs of that of hands, which sees only the mean colour (r, g, b). Coordinate i of
/// the points is i + b, of the world 0.01 i; the presence is sigmoid(8 r - 4), the handedness sigmoid(8 g - 4).
/// @param points of the hand
std::string colour_network(int points) {
  SmallModel model;
  const int in = model.tensor({1, kHandPixels, kHandPixels, 3}), colour = model.tensor({1, 3});
  model.step(Op::MEAN, {in, model.integers({2}, {1, 2})}, colour);
  const auto product = [&](const std::vector<float>& weights, const std::vector<float>& bias) {
    const int count = static_cast<int>(bias.size()), out = model.tensor({1, count});
    model.step(Op::FULLY_CONNECTED, {colour, model.constant({count, 3}, weights), model.constant({count}, bias)}, out,
               tflite::FullyConnectedOptionsT());
    return out;
  };
  const auto probability = [&](const std::vector<float>& weights) {
    const int logit = product(weights, {-4}), out = model.tensor({1, 1});
    model.step(Op::LOGISTIC, {logit}, out);
    return out;
  };
  std::vector<float> blue, none, numbers, metres;
  for (int i = 0; i < 3 * points; ++i) {
    blue.insert(blue.end(), {0, 0, 1});
    none.insert(none.end(), {0, 0, 0});
    numbers.push_back(static_cast<float>(i));
    metres.push_back(0.01f * static_cast<float>(i));
  }
  const int found = product(blue, numbers), presence = probability({8, 0, 0}), right = probability({0, 8, 0});
  return model.file({in}, {found, presence, right, product(none, metres)});
}

class HandDetectorTest : public ::testing::Test {
 protected:
  HandDetector detector_{network_of(colour_network(kNumHandPoints))};
  const BodyRoi roi_{{30, 25}, 2.0 * kHandPixels, 0};
};

TEST_F(HandDetectorTest, ReadsEachOutputOfTheNetwork) {
  const auto hand = detector_.read_hand(image_of(0.8, 0.2, 1), roi_);
  ASSERT_TRUE(hand);
  // The mean of 50,176 pixels is a sum in float32.
  EXPECT_NEAR(hand->score, 1 / (1 + std::exp(-2.4)), 1e-3);
  EXPECT_NEAR(hand->right, 1 / (1 + std::exp(2.4)), 1e-3);
  for (std::size_t i = 0; i < hand->points.size(); ++i) {
    const double first = 3 * static_cast<double>(i);
    const Eigen::Vector3d input(first + 1, first + 2, first + 3), corner(30 - kHandPixels, 25 - kHandPixels, 0);
    EXPECT_LT((hand->points[i] - (corner + 2 * input)).norm(), 1e-2) << i;
    EXPECT_LT((hand->world[i] - 0.01 * Eigen::Vector3d(first, first + 1, first + 2)).norm(), 1e-5) << i;
  }
}

TEST_F(HandDetectorTest, NeedsAProbabilityOfOneHalf) {
  EXPECT_FALSE(detector_.read_hand(image_of(0.49, 0, 0), roi_));
  EXPECT_TRUE(detector_.read_hand(image_of(0.51, 0, 0), roi_));
}

TEST_F(HandDetectorTest, RefusesOddImagesAndRegions) {
  EXPECT_FALSE(detector_.read_hand(image_of(1, 1, 1), {{0, 0}, 0, 0}));
  EXPECT_FALSE(detector_.read_hand(image_of(1, 1, 1), {{std::nan(""), 0}, 5, 0}));
  EXPECT_THROW(detector_.read_hand(cv::Mat(), roi_), UsageError);
  EXPECT_THROW(detector_.read_hand(cv::Mat(5, 5, CV_8UC1, cv::Scalar(0)), roi_), UsageError);
}

TEST_F(HandDetectorTest, FindsTheHandsOfABody) {
  BodyPose body{};
  for (const std::size_t landmark : {17, 18, 19, 20}) body.landmarks[landmark].y = 10;
  const HandPair hands = detector_.read_hands(image_of(0.8, 0.05, 0), body);
  EXPECT_TRUE(hands[0]);
  EXPECT_FALSE(hands[1]) << "a left hand";
}

TEST(HandDetector, RefusesOtherNetworks) {
  const NetworkModel other = network_of(colour_network(kNumHandPoints - 1));
  EXPECT_THAT(support::message_of<FileError>([&] { HandDetector{other}; }),
              HasSubstr("has other inputs or outputs than the network of hands"));
}

}  // namespace
}  // namespace doppel::hand_detector_test
