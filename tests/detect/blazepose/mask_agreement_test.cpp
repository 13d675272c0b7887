#include "doppel/detect/blazepose/mask_agreement.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "doppel/core/error.h"
#include "doppel/detect/blazepose/possible_parts.h"

namespace doppel::mask_agreement_test {
namespace {

constexpr int kPixels = 160;
const Eigen::Vector3d kMiddle(0.1, 1.0, -0.2);
constexpr double kRadius = 0.4;

/// Cameras on a circle around the sphere; those of odd numbers stand higher and have a lens with distortion.
std::vector<Camera> cameras(int count) {
  std::vector<Camera> result;
  for (int i = 0; i < count; ++i) {
    Camera camera;
    camera.name = "camera" + std::to_string(i);
    camera.width = camera.height = kPixels;
    camera.K << 180, 0, kPixels / 2.0, 0, 180, kPixels / 2.0, 0, 0, 1;
    const double angle = 2 * std::numbers::pi * i / count;
    const Eigen::Vector3d centre =
        kMiddle + Eigen::Vector3d(3 * std::cos(angle), i % 2 == 1 ? 1.0 : 0.0, 3 * std::sin(angle));
    const Eigen::Vector3d forward = (kMiddle - centre).normalized();
    const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitY()).normalized();
    camera.R << right.transpose(), forward.cross(right).transpose(), forward.transpose();
    camera.t = -camera.R * centre;
    if (i % 2 == 1) camera.distortion[0] = -0.08;
    result.push_back(camera);
  }
  return result;
}

/// The pixels whose rays meet the sphere, by dense points of its surface.
cv::Mat sphere_mask(const Camera& camera) {
  cv::Mat mask = cv::Mat::zeros(kPixels, kPixels, CV_8U);
  for (int i = 0; i < 400; ++i)
    for (int j = 0; j < 800; ++j) {
      const double polar = std::numbers::pi * i / 400, azimuth = 2 * std::numbers::pi * j / 800;
      const Eigen::Vector3d direction(std::sin(polar) * std::cos(azimuth), std::cos(polar),
                                      std::sin(polar) * std::sin(azimuth));
      const Eigen::Vector2d pixel = camera.project(kMiddle + kRadius * direction);
      mask.at<std::uint8_t>(static_cast<int>(pixel.y()), static_cast<int>(pixel.x())) = 255;
    }
  return mask;
}

std::vector<cv::Mat> sphere_masks(const std::vector<Camera>& views) {
  std::vector<cv::Mat> masks;
  for (const Camera& camera : views) masks.push_back(sphere_mask(camera));
  return masks;
}

TEST(MaskAgreement, AFalseBlobOfOneCameraIsRemovedAndTheSphereStays) {
  const std::vector<Camera> views = cameras(6);
  const std::vector<cv::Mat> ground_truth = sphere_masks(views);
  std::vector<cv::Mat> masks;
  for (const cv::Mat& mask : ground_truth) masks.push_back(mask.clone());
  cv::circle(masks[2], {20, 130}, 9, 255, -1);
  const long blob = cv::countNonZero(masks[2]) - cv::countNonZero(ground_truth[2]);
  EXPECT_EQ(settle_masks(masks, views).removed, blob);
  for (std::size_t i = 0; i < masks.size(); ++i) EXPECT_EQ(cv::countNonZero(masks[i] != ground_truth[i]), 0) << i;
}

TEST(MaskAgreement, OneCameraThatMissesAPartDoesNotSpoilTheOthers) {
  const std::vector<Camera> views = cameras(6);
  const std::vector<cv::Mat> ground_truth = sphere_masks(views);
  std::vector<cv::Mat> masks;
  for (const cv::Mat& mask : ground_truth) masks.push_back(mask.clone());
  masks[0].rowRange(0, kPixels / 2).setTo(0);
  EXPECT_EQ(settle_masks(masks, views).removed, 0);
  EXPECT_GT(settle_masks(masks, views, {.share = 1}).removed, 0);
}

TEST(MaskAgreement, CamerasThatSawNobodyHaveNoSay) {
  const std::vector<Camera> views = cameras(6);
  std::vector<cv::Mat> masks = sphere_masks(views);
  masks[0].setTo(0);
  masks[3] = cv::Mat();
  EXPECT_EQ(settle_masks(masks, views).removed, 0);
  masks[1].setTo(0);
  masks[2].setTo(0);
  masks[4].setTo(255);  // two masks are left
  EXPECT_EQ(settle_masks(masks, views).removed, 0);
}

TEST(MaskAgreement, WhatTheOthersHaveNotInTheirImagesStays) {
  std::vector<Camera> views = cameras(3);
  std::vector<cv::Mat> masks = sphere_masks(views);
  // The second camera shows the upper part of the sphere alone.
  views[1].height = kPixels / 2;
  masks[1] = masks[1].rowRange(0, kPixels / 2).clone();
  const int before = cv::countNonZero(masks[0]) + cv::countNonZero(masks[2]);
  settle_masks(masks, views);
  EXPECT_EQ(cv::countNonZero(masks[0]) + cv::countNonZero(masks[2]), before);
}

TEST(MaskAgreement, AMissingPartThatTheOthersSeeIsAdded) {
  const std::vector<Camera> views = cameras(6);
  const std::vector<cv::Mat> ground_truth = sphere_masks(views);
  std::vector<cv::Mat> masks;
  for (const cv::Mat& mask : ground_truth) masks.push_back(mask.clone());
  const cv::Mat upper_half = ground_truth[0].rowRange(0, kPixels / 2);
  masks[0].rowRange(0, kPixels / 2).setTo(kPossiblePerson, upper_half);
  const auto [removed, added] = settle_masks(masks, views);
  EXPECT_EQ(removed, 0);
  EXPECT_EQ(added, cv::countNonZero(upper_half));
  for (std::size_t i = 0; i < masks.size(); ++i) EXPECT_EQ(cv::countNonZero(masks[i] != ground_truth[i]), 0) << i;
}

TEST(MaskAgreement, APossiblePartWithoutSupportBecomesBackground) {
  const std::vector<Camera> views = cameras(3);
  const std::vector<cv::Mat> ground_truth = sphere_masks(views);
  std::vector<cv::Mat> masks;
  for (const cv::Mat& mask : ground_truth) masks.push_back(mask.clone());
  cv::circle(masks[2], {20, 130}, 9, kPossiblePerson, -1);
  EXPECT_EQ(settle_masks(masks, views).added, 0);
  for (std::size_t i = 0; i < masks.size(); ++i) EXPECT_EQ(cv::countNonZero(masks[i] != ground_truth[i]), 0) << i;

  masks[1].setTo(0);  // two masks are left: nothing is added
  masks[0].setTo(kPossiblePerson, ground_truth[0]);
  masks[0].row(kPixels / 2).setTo(255, ground_truth[0].row(kPixels / 2));
  const int before = cv::countNonZero(masks[0] == 255);
  EXPECT_EQ(settle_masks(masks, views).added, 0);
  EXPECT_EQ(cv::countNonZero(masks[0]), before);
}

TEST(MaskAgreement, WrongInputIsRefused) {
  const std::vector<Camera> views = cameras(3);
  std::vector<cv::Mat> masks = sphere_masks(views);
  EXPECT_THROW(settle_masks(masks, std::span(views).first(2)), UsageError);
  EXPECT_THROW(settle_masks(masks, views, {.share = 0}), UsageError);
  EXPECT_THROW(settle_masks(masks, views, {.possible_share = 1.5}), UsageError);
  EXPECT_THROW(settle_masks(masks, views, {.step = 0}), UsageError);
  masks[1] = cv::Mat::zeros(5, 5, CV_8U);
  EXPECT_THROW(settle_masks(masks, views), UsageError);
}

}  // namespace
}  // namespace doppel::mask_agreement_test
