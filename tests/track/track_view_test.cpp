#include "doppel/track/track_view.h"

#include <gtest/gtest.h>

namespace doppel::track_view_test {
namespace {

TEST(Composite, ShowsTheTextureBelowWhereALogoIsTransparent) {
  const cv::Mat below(8, 8, CV_8UC3, cv::Scalar(10, 200, 90));
  cv::Mat logo(4, 4, CV_8UC4, cv::Scalar(250, 0, 50, 0));
  logo.at<cv::Vec4b>(1, 2)[3] = 255;
  logo.at<cv::Vec4b>(3, 0)[3] = 51;  // a fifth
  const cv::Mat seen = composite(logo, below);
  ASSERT_EQ(seen.size(), logo.size());
  EXPECT_EQ(seen.at<cv::Vec3b>(0, 0), cv::Vec3b(10, 200, 90));
  EXPECT_EQ(seen.at<cv::Vec3b>(1, 2), cv::Vec3b(250, 0, 50));
  EXPECT_EQ(seen.at<cv::Vec3b>(3, 0), cv::Vec3b(58, 160, 82));
}

TEST(Composite, LeavesAnImageWithoutAlphaAsItIs) {
  const cv::Mat texture(2, 2, CV_8UC3, cv::Scalar(1, 2, 3));
  EXPECT_EQ(composite(texture, cv::Mat(8, 8, CV_8UC3, cv::Scalar(9, 9, 9))).at<cv::Vec3b>(1, 1), cv::Vec3b(1, 2, 3));
}

}  // namespace
}  // namespace doppel::track_view_test
