#include "doppel/track/refine/drawn_surface.h"

#include <gtest/gtest.h>

#include "doppel/core/error.h"

namespace doppel::drawn_surface_test {
namespace {

/// A square of one metre that faces the camera; its texture is blue above and red below.
TriangleMesh painted_square() {
  TriangleMesh mesh;
  mesh.vertices = {{-0.5, -0.5, 0.0}, {0.5, -0.5, 0.0}, {0.5, 0.5, 0.0}, {-0.5, 0.5, 0.0}};
  mesh.faces = {{0, 1, 2}, {0, 2, 3}};
  mesh.uvs = {{0, 1}, {1, 1}, {1, 0}, {0, 0}};
  mesh.face_uvs = mesh.faces;
  mesh.texture = cv::Mat(64, 64, CV_8UC3, cv::Scalar(255, 0, 0));
  mesh.texture.rowRange(32, 64) = cv::Scalar(0, 0, 255);
  return mesh;
}

/// A camera two metres before the square, which takes 50 pixels of its image.
PinholeCamera camera_before() {
  PinholeCamera camera;
  camera.width = 120;
  camera.height = 100;
  camera.K << 100, 0, 60, 0, 100, 50, 0, 0, 1;
  camera.R = Eigen::Matrix3d::Identity();
  camera.t = {0, 0, 2};
  return camera;
}

TEST(DrawnSurfaceReference, HasTheColoursOfTheTextureAtTheRightPixels) {
  const TriangleMesh mesh = painted_square();
  const DrawnSurface drawn = SurfaceDrawer(mesh).draw(mesh.vertices, camera_before());
  EXPECT_EQ(cv::countNonZero(drawn.covered), 50 * 50);
  const auto colour = [&](int x, int y) { return drawn.colour.at<cv::Vec3b>(y - drawn.box.y, x - drawn.box.x); };
  EXPECT_EQ(colour(60, 35), cv::Vec3b(255, 0, 0));
  EXPECT_EQ(colour(60, 65), cv::Vec3b(0, 0, 255));
  EXPECT_EQ(colour(33, 50), cv::Vec3b(0, 0, 0)) << "beside the square";
  EXPECT_NEAR(drawn.depth.at<float>(50 - drawn.box.y, 60 - drawn.box.x), 2.0F, 1e-5F);
}

TEST(DrawnSurfaceReference, EndsAtTheImage) {
  const TriangleMesh mesh = painted_square();
  PinholeCamera camera = camera_before();
  camera.K(0, 2) = 0;  // the left half of the square lies outside
  const DrawnSurface drawn = SurfaceDrawer(mesh).draw(mesh.vertices, camera);
  EXPECT_EQ(drawn.box.x, 0);
  EXPECT_EQ(cv::countNonZero(drawn.covered), 25 * 50);
}

TEST(DrawnSurfaceReference, IsEmptyOutsideOfTheImageAndBehindTheCamera) {
  const TriangleMesh mesh = painted_square();
  SurfaceDrawer drawer(mesh);
  PinholeCamera beside = camera_before(), behind = camera_before();
  beside.K(0, 2) = 1000;
  behind.t.z() = -2;
  EXPECT_TRUE(drawer.draw(mesh.vertices, beside).empty());
  EXPECT_TRUE(drawer.draw(mesh.vertices, behind).empty());
}

TEST(DrawnSurfaceRejects, AMeshWithoutTexture) {
  TriangleMesh mesh = painted_square();
  mesh.texture = cv::Mat();
  EXPECT_THROW(SurfaceDrawer{mesh}, Error);
}

}  // namespace
}  // namespace doppel::drawn_surface_test
