#include "doppel/geometry/undistorter.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace doppel::undistorter_test {
namespace {

// A dot at the pixel where the distorted camera sees a point is moved to the pixel where the pinhole sees the point.
TEST(UndistorterReference, MovesPointsToThePinholesPixels) {
  Camera camera;
  camera.R = Eigen::AngleAxisd(0.4, Eigen::Vector3d(0.6, 0.8, 0.0)).toRotationMatrix();
  camera.t = Eigen::Vector3d(0.3, -0.2, 3.0);
  camera.width = 400;
  camera.height = 300;
  camera.K << 300.0, 0.0, 203.3, 0.0, 310.0, 148.6, 0.0, 0.0, 1.0;
  camera.distortion = {-0.25, 0.07, 0.002, -0.001, 0.0, 0.0, 0.0, 0.0};
  const Undistorter undistorter(camera);
  EXPECT_FALSE(undistorter.pinhole().has_distortion());
  for (const Eigen::Vector3d& offset : {Eigen::Vector3d(-0.9, 0.5, 0.0), Eigen::Vector3d(0.7, -0.6, 0.2)}) {
    const Eigen::Vector3d point = camera.R.transpose() * (offset + Eigen::Vector3d(0, 0, 2.5) - camera.t);
    const Eigen::Vector2d distorted = camera.project(point), expected = undistorter.pinhole().project(point);
    cv::Mat image = cv::Mat::zeros(300, 400, CV_8U);
    // A soft dot: its centroid is the position to a fraction of a pixel. Pixel (c, r) has its centre at (c+0.5, r+0.5).
    for (int row = 0; row < 300; ++row)
      for (int column = 0; column < 400; ++column) {
        const double dx = column + 0.5 - distorted.x(), dy = row + 0.5 - distorted.y();
        image.at<std::uint8_t>(row, column) =
            static_cast<std::uint8_t>(std::lround(250 * std::exp(-(dx * dx + dy * dy) / 8)));
      }
    const cv::Moments moments = cv::moments(undistorter.apply(image));
    EXPECT_GT((distorted - expected).norm(), 3.0);
    EXPECT_NEAR(moments.m10 / moments.m00 + 0.5, expected.x(), 0.15);
    EXPECT_NEAR(moments.m01 / moments.m00 + 0.5, expected.y(), 0.15);
  }
}

}  // namespace
}  // namespace doppel::undistorter_test
