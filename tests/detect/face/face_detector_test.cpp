#include "doppel/detect/face/face_detector.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "detect/blazepose/small_model.h"
#include "detect/blazepose/small_network.h"
#include "doppel/core/error.h"
#include "support/message_of.h"

namespace doppel::face_detector_test {
namespace {

using support::image_of;
using support::network_of;
using support::SmallModel;
using Op = tflite::BuiltinOperator;
using ::testing::HasSubstr;

/// A network with the inputs and outputs of that of faces, which sees only the mean colour (r, g, b). Coordinate i of
/// the points is i + b, the presence is 8 r - 4.
/// @param points of the face
std::string colour_network(int points) {
  SmallModel model;
  const int in = model.tensor({1, kFacePixels, kFacePixels, 3}), colour = model.tensor({1, 3});
  model.step(Op::MEAN, {in, model.integers({2}, {1, 2})}, colour);
  const auto product = [&](const std::vector<float>& weights, const std::vector<float>& bias) {
    const int count = static_cast<int>(bias.size()), flat = model.tensor({1, count}),
              out = model.tensor({1, 1, 1, count});
    model.step(Op::FULLY_CONNECTED, {colour, model.constant({count, 3}, weights), model.constant({count}, bias)}, flat,
               tflite::FullyConnectedOptionsT());
    model.step(Op::RESHAPE, {flat}, out);
    return out;
  };
  std::vector<float> blue, numbers;
  for (int i = 0; i < 3 * points; ++i) {
    blue.insert(blue.end(), {0, 0, 1});
    numbers.push_back(static_cast<float>(i));
  }
  const int found = product(blue, numbers);
  return model.file({in}, {found, product({8, 0, 0}, {-4})});
}

class FaceDetectorTest : public ::testing::Test {
 protected:
  FaceDetector detector_{network_of(colour_network(kNumFacePoints))};
  const BodyRoi roi_{{30, 25}, 2.0 * kFacePixels, 0};
};

TEST_F(FaceDetectorTest, ReadsEachOutputOfTheNetwork) {
  const auto face = detector_.read_face(image_of(0.8, 0.2, 1), roi_);
  ASSERT_TRUE(face);
  // The mean of 36,864 pixels is a sum in float32.
  EXPECT_NEAR(face->score, 1 / (1 + std::exp(-2.4)), 1e-3);
  for (std::size_t i = 0; i < face->points.size(); ++i) {
    const double first = 3 * static_cast<double>(i);
    const Eigen::Vector3d input(first + 1, first + 2, first + 3), corner(30 - kFacePixels, 25 - kFacePixels, 0);
    EXPECT_LT((face->points[i] - (corner + 2 * input)).norm(), 1e-2) << i;
  }
}

TEST_F(FaceDetectorTest, NeedsAProbabilityOfOneHalf) {
  EXPECT_FALSE(detector_.read_face(image_of(0.49, 0, 0), roi_));
  EXPECT_TRUE(detector_.read_face(image_of(0.51, 0, 0), roi_));
}

TEST_F(FaceDetectorTest, RefusesOddImagesAndRegions) {
  EXPECT_FALSE(detector_.read_face(image_of(1, 1, 1), BodyRoi{{0, 0}, 0, 0}));
  EXPECT_FALSE(detector_.read_face(image_of(1, 1, 1), BodyRoi{{std::nan(""), 0}, 5, 0}));
  EXPECT_THROW(detector_.read_face(cv::Mat(), roi_), UsageError);
  EXPECT_THROW(detector_.read_face(cv::Mat(5, 5, CV_8UC1, cv::Scalar(0)), roi_), UsageError);
}

TEST_F(FaceDetectorTest, FindsTheFaceOfABody) {
  BodyPose body{};
  body.world.fill(Eigen::Vector3d::Zero());
  body.world[0].z() = -0.1;
  body.landmarks[2].x = 40;
  EXPECT_TRUE(detector_.read_face(image_of(0.8, 0, 0), body));
  body.world[0].z() = 0.1;
  EXPECT_FALSE(detector_.read_face(image_of(0.8, 0, 0), body)) << "it looks away";
}

TEST(FaceDetector, RefusesOtherNetworks) {
  const NetworkModel other = network_of(colour_network(kNumFacePoints - 1));
  EXPECT_THAT(support::message_of<FileError>([&] { FaceDetector{other}; }),
              HasSubstr("has other inputs or outputs than the network of faces"));
}

}  // namespace
}  // namespace doppel::face_detector_test
