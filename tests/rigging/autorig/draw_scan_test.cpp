#include "doppel/rigging/autorig/draw_scan.h"

#include <gtest/gtest.h>

namespace doppel::draw_scan_test {
namespace {

using Eigen::Vector3d;

/// A square of 1 m in the plane z = 0 that looks along +z.
TriangleMesh square() {
  TriangleMesh mesh;
  mesh.vertices = {{-0.5, 0, 0}, {0.5, 0, 0}, {0.5, 1, 0}, {-0.5, 1, 0}};
  mesh.faces = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}
Eigen::AlignedBox3d box_of(const TriangleMesh& mesh) {
  Eigen::AlignedBox3d box;
  for (const Vector3d& vertex : mesh.vertices) box.extend(vertex);
  return box;
}

TEST(DrawScan, CamerasSeeTheWholeBox) {
  const Eigen::AlignedBox3d box(Vector3d(-0.8, 0, -0.3), Vector3d(0.8, 1.8, 0.3));
  for (const double elevation : {0.0, 0.55})
    for (const PinholeCamera& camera : cameras_around(box, 7, elevation, 0.25, 400)) {
      EXPECT_TRUE(camera.faults().empty());
      const Eigen::Vector2d middle = camera.project(box.center());
      EXPECT_TRUE(middle.isApprox(Eigen::Vector2d(200, 200), 1e-9));
      for (int corner = 0; corner < 8; ++corner) {
        const Eigen::Vector2d pixel = camera.project(box.corner(static_cast<Eigen::AlignedBox3d::CornerType>(corner)));
        EXPECT_TRUE((pixel.array() > 0).all() && (pixel.array() < 400).all())
            << camera.name << ": " << pixel.transpose();
      }
    }
  EXPECT_GT(cameras_around(box, 4, 0.0, 0.0, 400)[0].centre().z(), 1.0);
  EXPECT_GT(cameras_around(box, 4, 0.0, 0.0, 400)[1].centre().x(), 1.0);
}

TEST(DrawScan, ColoursAndTexturesAreDrawnFromBothSides) {
  TriangleMesh coloured = square(), textured = square();
  coloured.colours.assign(4, Vector3d(0, 0, 1));
  textured.uvs = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  textured.face_uvs = textured.faces;
  textured.texture = cv::Mat(8, 8, CV_8UC3, cv::Scalar(0, 255, 0));
  const auto cameras = cameras_around(box_of(coloured), 2, 0.0, 0.0, 200);
  for (const PinholeCamera& camera : cameras) {
    const cv::Vec3b blue = ScanPainter(coloured).draw(camera).at<cv::Vec3b>(100, 100);
    EXPECT_GT(blue[0], 60);
    EXPECT_EQ(blue[1], 0);
    const cv::Vec3b green = ScanPainter(textured).draw(camera).at<cv::Vec3b>(100, 100);
    EXPECT_GT(green[1], 60);
    EXPECT_EQ(green[2], 0);
  }
  const cv::Mat image = ScanPainter(coloured).draw(cameras[0]);
  EXPECT_EQ(image.at<cv::Vec3b>(2, 2), cv::Vec3b(195, 190, 190)) << "the wall";
}

}  // namespace
}  // namespace doppel::draw_scan_test
