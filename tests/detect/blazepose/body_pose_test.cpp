#include "doppel/detect/blazepose/body_pose.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <set>
#include <string>

#include "doppel/detect/blazepose/network_input.h"

namespace doppel::body_pose_test {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

struct Outputs {
  std::vector<float> points = std::vector<float>(5 * kNetworkPoints, 0.0f);
  std::vector<float> heatmaps =
      std::vector<float>(std::size_t(kHeatmapPixels) * kHeatmapPixels * kNetworkPoints, -30.0f);
  std::vector<float> world = std::vector<float>(3 * kNetworkPoints, 0.0f);

  void set_point(int point, float x, float y, float z = 0) {
    points[std::size_t(5 * point)] = x;
    points[std::size_t(5 * point + 1)] = y;
    points[std::size_t(5 * point + 2)] = z;
  }
  void set_heat(int point, int row, int column, float logit) {
    heatmaps[std::size_t((row * kHeatmapPixels + column) * kNetworkPoints + point)] = logit;
  }
  BodyPose decode(const BodyRoi& roi) const { return decode_pose({points, heatmaps, world, 0.75f}, roi); }
};

const BodyRoi kUpright = {{128, 128}, 256, 0};  // pixels of the region are pixels of the image

TEST(DecodePose, ReadsPointsAndProbabilities) {
  Outputs outputs;
  outputs.set_point(3, 64, 32, -12.8f);
  outputs.points[5 * 3 + 3] = 1;
  outputs.points[5 * 3 + 4] = -2;
  const BodyPose pose = outputs.decode({{300, 400}, 512, 0});
  EXPECT_FLOAT_EQ(static_cast<float>(pose.score), 0.75f);
  EXPECT_NEAR(pose.landmarks[3].x, 300 + (64.0 / 256 - 0.5) * 512, 1e-9);
  EXPECT_NEAR(pose.landmarks[3].y, 400 + (32.0 / 256 - 0.5) * 512, 1e-9);
  EXPECT_NEAR(pose.landmarks[3].z, -25.6, 1e-5);
  EXPECT_NEAR(pose.landmarks[3].visibility, 1 / (1 + std::exp(-1.0)), 1e-12);
  EXPECT_NEAR(pose.landmarks[3].presence, 1 / (1 + std::exp(2.0)), 1e-12);
}

TEST(DecodePose, TurnsPointsAndJointsWithTheRegion) {
  Outputs outputs;
  outputs.set_point(0, 256, 128);
  outputs.world[0] = 1;
  outputs.world[2] = 0.5f;
  const BodyPose pose = outputs.decode({{10, 20}, 100, 0.5 * std::numbers::pi});
  EXPECT_LT((Vector2d(pose.landmarks[0].x, pose.landmarks[0].y) - Vector2d(10, 70)).norm(), 1e-9)
      << "the right side of the region is below its centre";
  EXPECT_LT((pose.world[0] - Vector3d(0, 1, 0.5)).norm(), 1e-9);
}

TEST(DecodePose, AMirroredRegionShowsTheOtherSide) {
  Outputs outputs;
  outputs.set_point(11, 64, 32, -12.8f);  // the left shoulder of the person in the mirror
  outputs.world[3 * 11] = 0.3f;
  outputs.world[3 * 11 + 1] = -0.4f;
  outputs.set_point(0, 100, 50);
  BodyRoi roi = kUpright;
  roi.mirrored = true;
  const BodyPose pose = outputs.decode(roi);
  EXPECT_NEAR(pose.landmarks[12].x, 256 - 64, 1e-9) << "the right shoulder";
  EXPECT_NEAR(pose.landmarks[12].y, 32, 1e-9);
  EXPECT_NEAR(pose.landmarks[12].z, -12.8, 1e-5);
  EXPECT_LT((pose.world[12] - Vector3d(-0.3, -0.4, 0)).norm(), 1e-6);
  EXPECT_NEAR(pose.landmarks[0].x, 156, 1e-9) << "the nose stays the nose";
  std::set<std::string> sides;
  for (int i = 0; i < kNumBodyLandmarks; ++i) {
    Outputs one;
    for (int other = 0; other < kNumBodyLandmarks; ++other) one.set_point(other, other == i ? 10.0f : 128.0f, 128);
    const BodyPose mirrored = one.decode(roi);
    for (int found = 0; found < kNumBodyLandmarks; ++found) {
      if (std::abs(mirrored.landmarks[std::size_t(found)].x - 246.0) > 1e-9) continue;
      std::string expected = kBodyLandmarkNames[std::size_t(i)];
      if (const auto left = expected.find("left"); left != std::string::npos)
        expected.replace(left, 4, "right");
      else if (const auto right = expected.find("right"); right != std::string::npos)
        expected.replace(right, 5, "left");
      EXPECT_EQ(kBodyLandmarkNames[std::size_t(found)], expected);
      sides.insert(expected);
    }
  }
  EXPECT_EQ(sides.size(), std::size_t(kNumBodyLandmarks));
}

TEST(MeanPose, IsTheMeanOfThePoints) {
  BodyPose first, second;
  first.landmarks[4] = {10, 20, 30, 0.5, 1.0};
  second.landmarks[4] = {20, 40, 10, 1.0, 0.5};
  first.world[4] = {1, 2, 3};
  second.world[4] = {3, 2, 1};
  first.score = 0.9;
  const BodyPose mean = mean_pose(first, second);
  EXPECT_NEAR(mean.landmarks[4].x, 15, 1e-12);
  EXPECT_NEAR(mean.landmarks[4].z, 20, 1e-12);
  EXPECT_NEAR(mean.landmarks[4].visibility, 0.75, 1e-12);
  EXPECT_LT((mean.world[4] - Vector3d(2, 2, 2)).norm(), 1e-12);
  EXPECT_EQ(mean.score, 0.9);
}

TEST(LandmarkConfidence, AFaceBehindTheHeadIsAGuess) {
  BodyPose pose;
  pose.world.fill(Vector3d::Zero());
  for (BodyLandmark& landmark : pose.landmarks) landmark.visibility = 0.9;
  pose.world[0].z() = -0.1;  // in front of the ears
  for (std::size_t i = 0; i < pose.landmarks.size(); ++i) EXPECT_NEAR(landmark_confidence(pose, i), 0.9, 1e-12);
  pose.world[0].z() = 0.1;
  const std::set<std::size_t> hidden = {0, 1, 2, 3, 4, 5, 6, 9, 10};
  for (std::size_t i = 0; i < pose.landmarks.size(); ++i)
    EXPECT_NEAR(landmark_confidence(pose, i), hidden.count(i) ? 0.09 : 0.9, 1e-12) << kBodyLandmarkNames[i];
}

TEST(DecodePose, MovesAPointToTheMeanOfItsHeatmap) {
  Outputs outputs;
  outputs.set_point(5, 4 * 20.5f, 4 * 30.5f);
  outputs.set_heat(5, 31, 22, 0);   // probability 1/2
  outputs.set_heat(5, 28, 17, 0);   // the window's edge: three cells away
  outputs.set_heat(5, 30, 24, 20);  // outside of the window
  outputs.set_heat(6, 30, 20, 20);  // another point's
  const BodyPose pose = outputs.decode(kUpright);
  EXPECT_NEAR(pose.landmarks[5].x, 4 * (22 + 17) / 2.0, 1e-6);
  EXPECT_NEAR(pose.landmarks[5].y, 4 * (31 + 28) / 2.0, 1e-6);
}

TEST(DecodePose, KeepsAPointWhoseHeatmapIsUncertain) {
  Outputs outputs;
  outputs.set_point(5, 82, 122);
  outputs.set_heat(5, 31, 22, -0.01f);
  const BodyPose pose = outputs.decode(kUpright);
  EXPECT_NEAR(pose.landmarks[5].x, 82, 1e-9);
  EXPECT_NEAR(pose.landmarks[5].y, 122, 1e-9);
}

TEST(DecodePose, ClipsTheWindowToTheHeatmap) {
  Outputs outputs;
  outputs.set_point(7, 1, 255);
  outputs.set_heat(7, 63, 0, 3);
  const BodyPose pose = outputs.decode(kUpright);
  EXPECT_NEAR(pose.landmarks[7].x, 0, 1e-6);
  EXPECT_NEAR(pose.landmarks[7].y, 4 * 63, 1e-6);
}

TEST(DecodePose, KeepsPointsOutsideOfTheHeatmap) {
  Outputs outputs;
  const float huge = 1e30f;
  for (const auto& [x, y] : {std::pair(-5.0f, 10.0f), std::pair(10.0f, 300.0f), std::pair(huge, -huge)}) {
    outputs.set_point(7, x, y);
    const BodyPose pose = outputs.decode(kUpright);
    EXPECT_FLOAT_EQ(static_cast<float>(pose.landmarks[7].x), x);
    EXPECT_FLOAT_EQ(static_cast<float>(pose.landmarks[7].y), y);
  }
}

TEST(DecodePose, TheNextRegionComesFromTwoExtraPoints) {
  Outputs outputs;
  outputs.set_point(33, 100, 150);
  outputs.set_point(34, 100, 90);
  const BodyPose pose = outputs.decode(kUpright);
  EXPECT_LT((pose.next_roi.centre - Vector2d(100, 150)).norm(), 1e-9);
  EXPECT_NEAR(pose.next_roi.side, 150, 1e-9);
  EXPECT_NEAR(pose.next_roi.rotation, 0, 1e-12);
}

TEST(BodyLandmarkNames, AreUnique) {
  EXPECT_EQ(std::set<std::string>(kBodyLandmarkNames.begin(), kBodyLandmarkNames.end()).size(), 33u);
  EXPECT_STREQ(kBodyLandmarkNames[11], "left_shoulder");
  EXPECT_STREQ(kBodyLandmarkNames[32], "right_foot_index");
}

std::vector<float> half_plane() {
  std::vector<float> logits(256 * 256);
  for (std::size_t i = 0; i < logits.size(); ++i) logits[i] = i % 256 < 128 ? 40.0f : -40.0f;  // the left half
  return logits;
}

TEST(DrawPersonMask, CopiesTheMaskOfAnUprightRegion) {
  const cv::Mat mask = draw_person_mask(half_plane(), kUpright, {300, 280});
  ASSERT_EQ(mask.type(), CV_8U);
  ASSERT_EQ(mask.size(), cv::Size(300, 280));
  EXPECT_EQ(cv::countNonZero(mask), 128 * 256);
  EXPECT_EQ(mask.at<std::uint8_t>(255, 127), 255);
  EXPECT_EQ(mask.at<std::uint8_t>(255, 128), 0);
  EXPECT_EQ(mask.at<std::uint8_t>(256, 0), 0) << "outside of the region";
}

TEST(DrawPersonMask, IsBilinearBetweenPixels) {
  // Half a pixel to the right: the border is between two columns.
  const cv::Mat mask = draw_person_mask(half_plane(), {{128.5, 128}, 256, 0}, {300, 280});
  EXPECT_EQ(mask.at<std::uint8_t>(100, 127), 255);
  EXPECT_EQ(mask.at<std::uint8_t>(100, 128), 128);
  EXPECT_EQ(mask.at<std::uint8_t>(100, 129), 0);
}

TEST(DrawPersonMask, FollowsARotatedRegion) {
  // Turned by a right angle: the left half of the region becomes the upper half.
  const cv::Mat mask = draw_person_mask(half_plane(), {{50, 60}, 40, 0.5 * std::numbers::pi}, {100, 120});
  EXPECT_EQ(cv::countNonZero(mask > 127), 40 * 20);
  EXPECT_EQ(mask.at<std::uint8_t>(42, 50), 255);
  EXPECT_EQ(mask.at<std::uint8_t>(78, 50), 0);
  EXPECT_EQ(mask.at<std::uint8_t>(38, 50), 0);
}

/// Each pixel computed alone, without the shortcuts.
TEST(DrawPersonMask, AgreesWithADirectEvaluation) {
  std::vector<float> logits(256 * 256);
  for (int y = 0, i = 0; y < 256; ++y)
    for (int x = 0; x < 256; ++x, ++i)
      logits[std::size_t(i)] = 60.0f - 0.01f * static_cast<float>((x - 90) * (x - 90) + (y - 140) * (y - 140));
  const BodyRoi roi{{70, 60}, 90, 0.4};
  const cv::Mat mask = draw_person_mask(logits, roi, {160, 130});
  const auto value = [&](int y, int x) {
    return 255 / (1 + std::exp(-double{logits[std::size_t(std::clamp(y, 0, 255) * 256 + std::clamp(x, 0, 255))]}));
  };
  for (int row = 0; row < mask.rows; ++row)
    for (int column = 0; column < mask.cols; ++column) {
      const Vector2d position = roi.roi_from_image({column + 0.5, row + 0.5}) * 256 - Vector2d(0.5, 0.5);
      const bool inside = (position.array() >= -0.5).all() && (position.array() <= 255.5).all();
      const int x = static_cast<int>(std::floor(position.x())), y = static_cast<int>(std::floor(position.y()));
      const double a = position.x() - x, b = position.y() - y;
      const double expected = inside ? (1 - b) * ((1 - a) * value(y, x) + a * value(y, x + 1)) +
                                           b * ((1 - a) * value(y + 1, x) + a * value(y + 1, x + 1))
                                     : 0;
      ASSERT_NEAR(mask.at<std::uint8_t>(row, column), expected, 0.51) << row << " " << column;
    }
}

cv::Mat ramp(int width, int height) {
  cv::Mat image(height, width, CV_8UC3);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      image.at<cv::Vec3b>(y, x) = {static_cast<std::uint8_t>(10 * x), static_cast<std::uint8_t>(10 * y), 200};
  return image;
}

TEST(SampleLetterbox, IsBlackOutsideOfTheImage) {
  std::vector<float> input(8 * 8 * 3);
  sample_letterbox(ramp(8, 4), 8, input);
  const auto at = [&](int row, int column, int channel) {
    return input[std::size_t((row * 8 + column) * 3 + channel)];
  };
  for (const int row : {0, 1, 6, 7})
    for (int c = 0; c < 3; ++c) EXPECT_EQ(at(row, 3, c), -1) << row;
  EXPECT_FLOAT_EQ(at(2, 3, 0), 2 * 200 / 255.0f - 1) << "red comes first";
  EXPECT_FLOAT_EQ(at(3, 3, 1), 2 * 10 / 255.0f - 1);
  EXPECT_FLOAT_EQ(at(3, 5, 2), 2 * 50 / 255.0f - 1);
}

TEST(SampleRoi, IsBilinearAndRepeatsTheBorder) {
  std::vector<float> input(4 * 4 * 3);
  // Four pixels of two image pixels each, from -2 to 6: samples at -1, 1, 3, 5.
  sample_roi(ramp(4, 4), {{2, 2}, 8, 0}, 4, input);
  const float expected[] = {0, 5, 25, 30};  // 10 * (position - 0.5), clamped to the last pixel's centre
  for (int column = 0; column < 4; ++column)
    EXPECT_NEAR(input[std::size_t(3 * column + 2)], expected[column] / 255, 1e-6);
}

TEST(SampleRoi, TurnsWithTheRegion) {
  std::vector<float> input(2 * 2 * 3);
  sample_roi(ramp(20, 20), {{10, 10}, 4, 0.5 * std::numbers::pi}, 2, input);
  // The region's x is the image's y (down), its y the image's -x.
  EXPECT_NEAR(input[0 * 3 + 1] * 255, 10 * (9 - 0.5), 1e-3);
  EXPECT_NEAR(input[1 * 3 + 1] * 255, 10 * (11 - 0.5), 1e-3);
  EXPECT_NEAR(input[0 * 3 + 2] * 255, 10 * (11 - 0.5), 1e-3);
  EXPECT_NEAR(input[2 * 3 + 2] * 255, 10 * (9 - 0.5), 1e-3);
}

}  // namespace
}  // namespace doppel::body_pose_test
