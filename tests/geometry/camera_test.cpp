#include "doppel/geometry/camera.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>
#include <random>

#include "doppel/core/error.h"

namespace doppel::camera_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

Camera example(bool distorted) {
  Camera camera;
  camera.name = "left";
  camera.width = 1280;
  camera.height = 960;
  camera.K << 1100, 0, 642.5, 0, 1102, 470.25, 0, 0, 1;
  camera.R = Eigen::AngleAxisd(2.8, Eigen::Vector3d(0.9, 0.1, -0.3).normalized()).toRotationMatrix();
  camera.t = {0.2, 0.9, 4.0};
  if (distorted) camera.distortion = {-0.2, 0.08, 1e-3, -2e-3, 0.01, 0.02, -0.01, 0.003};
  return camera;
}

std::vector<Eigen::Vector3d> points_in_view(const Camera& camera, int count) {
  std::mt19937 generator(7);
  std::uniform_real_distribution<double> unit(-1, 1);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d in_camera(unit(generator), unit(generator), 3.5 + unit(generator));
    points.push_back(camera.R.transpose() * (in_camera - camera.t));
  }
  return points;
}

TEST(CameraAgrees, ProjectionWithOpenCv) {
  for (bool distorted : {false, true}) {
    const Camera camera = example(distorted);
    cv::Mat K, R, t, rotation_vector;
    cv::eigen2cv(camera.K, K);
    cv::eigen2cv(camera.R, R);
    cv::eigen2cv(camera.t, t);
    cv::Rodrigues(R, rotation_vector);
    const std::vector<double> coefficients(camera.distortion.begin(), camera.distortion.begin() + 8);
    for (const Eigen::Vector3d& point : points_in_view(camera, 100)) {
      std::vector<cv::Point2d> expected;
      cv::projectPoints(std::vector<cv::Point3d>{{point.x(), point.y(), point.z()}}, rotation_vector, t, K,
                        coefficients, expected);
      const Eigen::Vector2d pixel = camera.project(point);
      EXPECT_NEAR(pixel.x(), expected[0].x, 1e-6);
      EXPECT_NEAR(pixel.y(), expected[0].y, 1e-6);
    }
  }
}

/// The pixels of points by OpenCV's own functions.
std::vector<Eigen::Vector2d> opencv_pixels(const Camera& camera, const std::vector<Eigen::Vector3d>& points,
                                           int count) {
  cv::Mat K, R, t, rotation_vector;
  cv::eigen2cv(camera.K, K);
  cv::eigen2cv(camera.R, R);
  cv::eigen2cv(camera.t, t);
  cv::Rodrigues(R, rotation_vector);
  const std::vector<double> coefficients(camera.distortion.begin(), camera.distortion.begin() + count);
  std::vector<cv::Point3d> from;
  for (const Eigen::Vector3d& point : points) from.emplace_back(point.x(), point.y(), point.z());
  std::vector<cv::Point2d> to;
  if (camera.lens == Lens::fisheye)
    cv::fisheye::projectPoints(from, to, rotation_vector, t, K, coefficients);
  else
    cv::projectPoints(from, rotation_vector, t, K, coefficients, to);
  std::vector<Eigen::Vector2d> pixels;
  for (const cv::Point2d& pixel : to) pixels.emplace_back(pixel.x, pixel.y);
  return pixels;
}

Camera with_lens(Lens lens, const std::array<double, 14>& distortion) {
  Camera camera = example(false);
  camera.lens = lens;
  camera.distortion = distortion;
  return camera;
}
const Camera kFisheye = with_lens(Lens::fisheye, {-0.03, 0.01, -0.004, 0.0007});
const Camera kTilted =
    with_lens(Lens::opencv, {-0.2, 0.08, 1e-3, -2e-3, 0.01, 0.02, -0.01, 0.003, 1e-3, -2e-3, 5e-4, 1e-3, 0.03, -0.02});
const Camera kPolynomial = with_lens(Lens::polynomial, {-0.2, 0.08, 1e-3, -2e-3, 0.01, 0.02});

TEST(CameraAgrees, FisheyeThinPrismAndTiltWithOpenCv) {
  for (const auto& [camera, count] : {std::pair{kFisheye, 4}, std::pair{kTilted, 14}}) {
    const std::vector<Eigen::Vector3d> points = points_in_view(camera, 100);
    const std::vector<Eigen::Vector2d> expected = opencv_pixels(camera, points, count);
    for (std::size_t i = 0; i < points.size(); ++i) EXPECT_LT((camera.project(points[i]) - expected[i]).norm(), 1e-6);
  }
}

TEST(CameraAgrees, ThePolynomialLensWithItsFormula) {
  const double x = 0.3, y = -0.2, r2 = x * x + y * y;
  const double radial = 1 - 0.2 * r2 + 0.08 * std::pow(r2, 2) + 0.01 * std::pow(r2, 3) + 0.02 * std::pow(r2, 4);
  const Eigen::Vector2d found = kPolynomial.distorted({x, y});
  EXPECT_NEAR(found.x(), x * radial + 2 * 1e-3 * x * y - 2e-3 * (r2 + 2 * x * x), 1e-15);
  EXPECT_NEAR(found.y(), y * radial + 1e-3 * (r2 + 2 * y * y) - 2 * 2e-3 * x * y, 1e-15);
}

TEST(CameraAgrees, UndistortedIsTheInverseOfDistorted) {
  for (const Camera& camera : {example(false), example(true), kFisheye, kTilted, kPolynomial})
    for (double x = -0.7; x < 0.75; x += 0.1)
      for (double y = -0.5; y < 0.55; y += 0.1) {
        const auto found = camera.undistorted(camera.distorted({x, y}));
        ASSERT_TRUE(found);
        EXPECT_LT((*found - Eigen::Vector2d(x, y)).norm(), 1e-11);
      }
  const Camera folded = with_lens(Lens::opencv, {-0.5});
  EXPECT_FALSE(folded.undistorted({10.0, 10.0})) << "no point of this lens is there";
}

TEST(CameraAgrees, ProjectionMatrixWithProject) {
  Camera camera = example(false);
  camera.K(0, 1) = 3;  // skew
  EXPECT_FALSE(camera.has_distortion());
  EXPECT_TRUE(example(true).has_distortion());
  for (const Eigen::Vector3d& point : points_in_view(camera, 20)) {
    const Eigen::Vector3d h = camera.projection() * point.homogeneous();
    EXPECT_LT((h.hnormalized() - camera.project(point)).norm(), 1e-9);
    EXPECT_NEAR(h.z(), camera.camera_from_world(point).z(), 1e-12);
  }
  EXPECT_LT(camera.camera_from_world(camera.centre()).norm(), 1e-12);
}

TEST(CameraReference, ScalingAndCroppingMovePixelsAsTheImageDoes) {
  const Camera camera = example(true);
  const Camera half = camera.scaled_to(640, 480), crop = camera.cropped(100, 50, 0.25, 128, 96);
  EXPECT_EQ(half.width, 640);
  EXPECT_EQ(crop.height, 96);
  for (const Eigen::Vector3d& point : points_in_view(camera, 20)) {
    const Eigen::Vector2d pixel = camera.project(point);
    EXPECT_LT((half.project(point) - pixel / 2).norm(), 1e-9);
    EXPECT_LT((crop.project(point) - 0.25 * (pixel - Eigen::Vector2d(100, 50))).norm(), 1e-9);
  }
  EXPECT_THAT(half.faults(), IsEmpty());
  EXPECT_THAT(crop.faults(), IsEmpty());
}

TEST(CameraRejects, AnotherAspectRatio) {
  const Camera camera = example(false);
  EXPECT_NO_THROW(camera.scaled_to(641, 480)) << "rounding to whole pixels";
  EXPECT_THROW(camera.scaled_to(640, 500), Error);
  EXPECT_THROW(camera.scaled_to(0, 0), Error);
  EXPECT_THROW(camera.scaled_to(-640, -480), Error);
}

TEST(CameraRejects, Faults) {
  const auto faults_after = [](const std::function<void(Camera&)>& change) {
    Camera camera = example(false);
    change(camera);
    return camera.faults();
  };
  EXPECT_THAT(example(true).faults(), IsEmpty());
  EXPECT_THAT(faults_after([](Camera& c) { c.width = 0; }),
              ElementsAre(HasSubstr("camera left: the image size is 0x960")));
  EXPECT_THAT(faults_after([](Camera& c) { c.K(1, 1) = -1; }), ElementsAre(HasSubstr("must be positive")));
  EXPECT_THAT(faults_after([](Camera& c) { c.K(2, 2) = 2; }), ElementsAre(HasSubstr("intrinsic matrix")));
  EXPECT_THAT(faults_after([](Camera& c) { c.R *= 1.01; }), ElementsAre(HasSubstr("not a rotation")));
  EXPECT_THAT(faults_after([](Camera& c) { c.R.row(1) *= -1; }), ElementsAre(HasSubstr("mirrors")));
  EXPECT_THAT(faults_after([](Camera& c) { c.t.x() = std::nan(""); }), ElementsAre(HasSubstr("not finite")));
  EXPECT_THAT(faults_after([](Camera& c) { c.distortion[3] = std::numeric_limits<double>::infinity(); }),
              ElementsAre(HasSubstr("not finite")));
}

}  // namespace
}  // namespace doppel::camera_test
