#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "doppel/detect/keypoints/keypoints.h"

namespace doppel::choose_person_test {
namespace {

TEST(ChosenPerson, IsTheSurestOrTheOneOnTheMask) {
  const Person left{{10, 10, 0.5f}, {12, 30, 0.5f}}, right{{80, 10, 0.9f}, {82, 30, 0.9f}};
  EXPECT_FALSE(choose_person({}).has_value());
  EXPECT_EQ((*choose_person({left}))[0].x, 10);
  EXPECT_EQ((*choose_person({left, right}))[0].x, 80);
  cv::Mat mask = cv::Mat::zeros(50, 100, CV_8U);
  EXPECT_EQ((*choose_person({left, right}, mask))[0].x, 80) << "an empty mask says nothing";
  cv::rectangle(mask, cv::Rect(5, 5, 20, 40), 255, cv::FILLED);
  EXPECT_EQ((*choose_person({left, right}, mask))[0].x, 10);
  const Person outside{{-5, 500, 1.0f}};
  EXPECT_EQ((*choose_person({outside, left}, mask))[0].x, 10);
  const Person far_away{{1e20f, 10, 1.0f}, {-1e20f, -1e20f, 1.0f}};
  EXPECT_EQ((*choose_person({far_away, left}, mask))[0].x, 10);
  cv::Mat other = cv::Mat::zeros(50, 100, CV_8U);
  cv::rectangle(other, cv::Rect(45, 20, 4, 4), 255, cv::FILLED);
  EXPECT_EQ((*choose_person({left, right}, other))[0].x, 80) << "nobody is on this mask";
}

}  // namespace
}  // namespace doppel::choose_person_test
