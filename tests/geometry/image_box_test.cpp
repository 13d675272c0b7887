#include "doppel/geometry/image_box.h"

#include <gtest/gtest.h>

namespace doppel {
namespace {

/// A camera at the origin of 100 x 80 pixels; a point (x, y, 1) is seen at (100 x, 100 y).
PinholeCamera camera_at_origin() {
  PinholeCamera camera;
  camera.width = 100;
  camera.height = 80;
  camera.K << 100, 0, 0, 0, 100, 0, 0, 0, 1;
  return camera;
}

TEST(ImageBox, HoldsThePointsAndItsMarginWithinTheImage) {
  const PinholeCamera camera = camera_at_origin();
  EXPECT_EQ(image_box({{0.205, 0.3, 1.0}, {0.6, 0.401, 1.0}}, camera, 0), cv::Rect(20, 30, 40, 11));
  EXPECT_EQ(image_box({{0.205, 0.3, 1.0}, {0.6, 0.401, 1.0}}, camera, 25), cv::Rect(0, 5, 85, 61));
  EXPECT_EQ(image_box({{0.5, 0.5, 1.0}, {9.0, 9.0, 1.0}}, camera, 0), cv::Rect(50, 50, 50, 30));
}

TEST(ImageBox, PointsBehindTheCameraDoNotCount) {
  const PinholeCamera camera = camera_at_origin();
  EXPECT_EQ(image_box({{0.2, 0.3, 1.0}, {0.6, 0.4, 1.0}, {0.1, 0.1, -1.0}}, camera, 0), cv::Rect(20, 30, 40, 10));
  EXPECT_TRUE(image_box({{0.1, 0.1, -1.0}}, camera, 10).empty());
  EXPECT_TRUE(image_box({{1.2, 0.1, 1.0}, {1.4, 0.3, 1.0}}, camera, 10).empty()) << "beside the image";
  EXPECT_TRUE(image_box({}, camera, 10).empty());
}

}  // namespace
}  // namespace doppel
