#include "doppel/track/shape/texture_bake.h"

#include <gmock/gmock.h>

#include "doppel/core/error.h"
#include "support/message_of.h"
#include "support/ring_of_cameras.h"

namespace doppel::texture_bake_test {
namespace {

using Eigen::Vector3d;

constexpr int kRings = 24, kCorners = 48, kTexels = 128;
constexpr double kRadius = 0.3, kHeight = 1.0;

/// An upright cylinder about the y axis without caps, its texture unrolled around it.
TriangleMesh cylinder() {
  TriangleMesh mesh;
  for (int ring = 0; ring <= kRings; ++ring)
    for (int corner = 0; corner <= kCorners; ++corner) {
      const double u = static_cast<double>(corner) / kCorners, v = static_cast<double>(ring) / kRings;
      mesh.uvs.emplace_back(u, v);
      if (corner == kCorners) continue;
      mesh.vertices.emplace_back(kRadius * std::sin(2 * M_PI * u), kHeight * v, kRadius * std::cos(2 * M_PI * u));
    }
  for (int ring = 0; ring < kRings; ++ring)
    for (int corner = 0; corner < kCorners; ++corner) {
      const int next = (corner + 1) % kCorners, a = ring * kCorners + corner, b = ring * kCorners + next;
      const int t = ring * (kCorners + 1) + corner;
      mesh.faces.push_back({a, b, b + kCorners});
      mesh.face_uvs.push_back({t, t + 1, t + 1 + kCorners + 1});
      mesh.faces.push_back({a, b + kCorners, a + kCorners});
      mesh.face_uvs.push_back({t, t + 1 + kCorners + 1, t + kCorners + 1});
    }
  return mesh;
}

/// The colour of a point of the cylinder, BGR.
cv::Vec3d colour_at(const Vector3d& p) {
  const double angle = std::atan2(p.x(), p.z());
  return {120 + 60 * std::sin(angle), 130 + 50 * std::cos(3 * angle), 60 + 100 * p.y() / kHeight};
}

/// The cylinder as a camera sees it: each pixel's ray is cut with the cylinder. @param gain of the camera's colours
cv::Mat photograph(const PinholeCamera& camera, double gain) {
  cv::Mat image(camera.height, camera.width, CV_8UC3, cv::Scalar(255, 0, 255));
  const Vector3d centre = camera.centre();
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const Vector3d ray = camera.R.transpose() * (camera.K.inverse() * Vector3d(x + 0.5, y + 0.5, 1.0));
      const double a = ray.x() * ray.x() + ray.z() * ray.z(), b = centre.x() * ray.x() + centre.z() * ray.z(),
                   c = centre.x() * centre.x() + centre.z() * centre.z() - kRadius * kRadius;
      if (b * b < a * c) continue;
      const Vector3d p = centre + (-b - std::sqrt(b * b - a * c)) / a * ray;
      if (p.y() < 0 || p.y() > kHeight) continue;
      const cv::Vec3d colour = gain * colour_at(p);
      for (int k = 0; k < 3; ++k) image.at<cv::Vec3b>(y, x)[k] = cv::saturate_cast<std::uint8_t>(colour[k]);
    }
  return image;
}

class BakedCylinder : public ::testing::Test {
 protected:
  /// Mean difference of texels from the ground truth at angles within the range, grey levels.
  double error(const cv::Mat& texture, double first_angle, double last_angle) const {
    double sum = 0;
    int count = 0;
    for (int y = 4; y < texture.rows - 4; ++y)
      for (int x = 0; x < texture.cols; ++x) {
        const double angle = 2 * M_PI * (x + 0.5) / texture.cols;
        if (angle < first_angle || angle > last_angle) continue;
        const Vector3d p(kRadius * std::sin(angle), kHeight * (1 - (y + 0.5) / texture.rows),
                         kRadius * std::cos(angle));
        for (int k = 0; k < 3; ++k, ++count) sum += std::abs(texture.at<cv::Vec3b>(y, x)[k] - colour_at(p)[k]);
      }
    return sum / count;
  }
  const TriangleMesh mesh_ = cylinder();
  const std::vector<PinholeCamera> cameras_ = ring_of_cameras(6, 256, {0, kHeight / 2, 0});
};

TEST_F(BakedCylinder, HasTheColoursOfTheImages) {
  TextureBake bake(mesh_, kTexels);
  for (std::size_t c = 0; c < cameras_.size(); ++c)
    bake.add(mesh_.vertices, cameras_[c], static_cast<int>(c), photograph(cameras_[c], 1.0), {});
  EXPECT_GT(bake.coverage(), 0.9);
  EXPECT_LT(error(bake.texture(), 0, 2 * M_PI), 2.0);
}

TEST_F(BakedCylinder, CamerasOfOtherExposureAreEvened) {
  TextureBake bake(mesh_, kTexels);
  for (std::size_t c = 0; c < cameras_.size(); ++c)
    bake.add(mesh_.vertices, cameras_[c], static_cast<int>(c), photograph(cameras_[c], c == 2 ? 0.7 : 1.0), {});
  const auto gains = bake.gains();
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(gains.at(2)[k] / gains.at(0)[k], 1 / 0.7, 0.03);
    EXPECT_NEAR(gains.at(3)[k] / gains.at(0)[k], 1.0, 0.02);
  }
}

TEST_F(BakedCylinder, HiddenTexelsTakeColoursFromTheirNeighbours) {
  TextureBake bake(mesh_, kTexels);
  bake.add(mesh_.vertices, cameras_[0], 0, photograph(cameras_[0], 1.0), {});
  EXPECT_GT(bake.coverage(), 0.25);
  EXPECT_LT(bake.coverage(), 0.5);
  const cv::Mat texture = bake.texture();
  double low = 255, high = 0;
  cv::minMaxLoc(texture.reshape(1), &low, &high);
  EXPECT_GT(low, 40) << "no black holes, and nothing of the background";
  EXPECT_LT(high, 200);
}

/// The texels beside a chart repeat its edge, so a look-up between texels meets no other colour.
TEST_F(BakedCylinder, ChartsArePadded) {
  TriangleMesh half = mesh_;
  for (Eigen::Vector2d& uv : half.uvs) uv = {0.25 + 0.5 * uv.x(), 0.25 + 0.5 * uv.y()};
  TextureBake bake(half, kTexels);
  for (std::size_t c = 0; c < cameras_.size(); ++c)
    bake.add(half.vertices, cameras_[c], static_cast<int>(c), photograph(cameras_[c], 1.0), {});
  const cv::Mat texture = bake.texture();
  for (int y = kTexels / 4; y < 3 * kTexels / 4; ++y) {
    EXPECT_EQ(texture.at<cv::Vec3b>(y, kTexels / 4 - 1), texture.at<cv::Vec3b>(y, kTexels / 4));
    EXPECT_EQ(texture.at<cv::Vec3b>(y, 3 * kTexels / 4 + 2), texture.at<cv::Vec3b>(y, 3 * kTexels / 4 - 1));
    EXPECT_EQ(texture.at<cv::Vec3b>(y, 4), cv::Vec3b(0, 0, 0)) << "far from the chart";
  }
}

TEST_F(BakedCylinder, WhatTheMaskExcludesDoesNotCount) {
  TextureBake bake(mesh_, kTexels);
  const cv::Mat nobody = cv::Mat::zeros(cameras_[0].height, cameras_[0].width, CV_8U);
  bake.add(mesh_.vertices, cameras_[0], 0, photograph(cameras_[0], 1.0), nobody);
  EXPECT_EQ(bake.coverage(), 0.0);
  EXPECT_THAT(support::message_of<Error>([&] { static_cast<void>(bake.texture()); }),
              ::testing::HasSubstr("no image shows the surface"));
}

TEST_F(BakedCylinder, APartBehindAnotherIsHidden) {
  TriangleMesh two = mesh_;  // a second cylinder behind the first, without a texture of its own
  const Vector3d away = (Vector3d(0, cameras_[0].centre().y(), 0) - cameras_[0].centre()).normalized();
  const int shift = mesh_.num_vertices();
  for (const Vector3d& p : mesh_.vertices) two.vertices.push_back(p + 0.8 * Vector3d(away.x(), 0, away.z()));
  for (const Triangle& face : mesh_.faces) two.faces.push_back({face[0] + shift, face[1] + shift, face[2] + shift});
  for (const Triangle& face : mesh_.face_uvs) two.face_uvs.push_back(face);
  for (Eigen::Vector2d& uv : two.uvs) uv.x() *= 0.5;
  for (std::size_t f = mesh_.faces.size(); f < two.face_uvs.size(); ++f)
    for (int k = 0; k < 3; ++k) {
      two.uvs.push_back(two.uvs[mesh_.face_uvs[f - mesh_.faces.size()][k]] + Eigen::Vector2d(0.5, 0));
      two.face_uvs[f][k] = static_cast<int>(two.uvs.size()) - 1;
    }
  TextureBake alone(mesh_, kTexels), both(two, kTexels);
  alone.add(mesh_.vertices, cameras_[0], 0, photograph(cameras_[0], 1.0), {});
  both.add(two.vertices, cameras_[0], 0, photograph(cameras_[0], 1.0), {});
  EXPECT_NEAR(both.coverage(), 0.5 * alone.coverage(), 0.05) << "only the front one is seen";
}

}  // namespace
}  // namespace doppel::texture_bake_test
