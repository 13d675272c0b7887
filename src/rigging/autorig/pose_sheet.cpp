#include "doppel/rigging/autorig/pose_sheet.h"

#include <Eigen/Geometry>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "doppel/character/blend_skin.h"
#include "doppel/rigging/autorig/draw_scan.h"
#include "doppel/rigging/weights/test_poses.h"

namespace doppel {

namespace {

using Eigen::AlignedBox3d;
using Eigen::Vector3d;

constexpr int kSides = 4;
constexpr double kElevation = 0.1;  // radians
constexpr double kPhase = 0.35;     // of the first camera, in steps between cameras
constexpr double kBorder = 0.03;    // around the bodies, as a share of the extent of all bodies
constexpr double kLabel = 0.05;     // room for the name of the pose, in the same way

AlignedBox3d box_around(const std::vector<Vector3d>& vertices) {
  AlignedBox3d box;
  for (const Vector3d& vertex : vertices) box.extend(vertex);
  return box;
}

/// Puts a posed body on the floor, with the middle of its box above the origin.
void put_on_floor(std::vector<Vector3d>& vertices) {
  const AlignedBox3d box = box_around(vertices);
  const Vector3d shift(-box.center().x(), -box.min().y(), -box.center().z());
  for (Vector3d& vertex : vertices) vertex += shift;
}

/// Cuts the images of all cameras to the same rectangle, that in which bodies are seen, and scales them to a height.
void zoom_to_bodies(std::vector<PinholeCamera>& cameras, const std::vector<std::vector<Vector3d>>& bodies, int height) {
  Eigen::AlignedBox2d seen;
  for (const PinholeCamera& camera : cameras)
    for (const auto& body : bodies)
      for (const Vector3d& vertex : body) seen.extend(camera.project(vertex));
  const Eigen::Vector2d border = Eigen::Vector2d::Constant(kBorder * seen.sizes().y());
  const Eigen::Vector2d label(0.0, kLabel * seen.sizes().y());
  const Eigen::Vector2d low = seen.min() - border - label, extent = seen.sizes() + 2.0 * border + label;
  const double scale = height / extent.y();
  for (PinholeCamera& camera : cameras) {
    camera.K.topRightCorner<2, 1>() -= low;
    camera.K.topRows<2>() *= scale;
    camera.width = static_cast<int>(std::ceil(scale * extent.x()));
    camera.height = height;
  }
}

void write_label(cv::Mat& image, const std::string& text) {
  const double scale = image.rows / 600.0;
  const cv::Point at(image.rows / 60, image.rows / 22);
  cv::putText(image, text, at, cv::FONT_HERSHEY_SIMPLEX, scale, cv::Scalar::all(0), 1, cv::LINE_AA);
}

}  // namespace

cv::Mat draw_pose_sheet(const Character& character, int height) {
  std::vector<TestPose> poses = test_poses(character.skeleton, character.rest_dofs);
  poses.insert(poses.begin(), {"rest pose", character.rest_dofs});
  std::vector<std::vector<Vector3d>> bodies;
  AlignedBox3d box;
  for (const TestPose& pose : poses) {
    bodies.push_back(posed_vertices(character, pose.dofs));
    put_on_floor(bodies.back());
    box.extend(box_around(bodies.back()));
  }
  std::vector<PinholeCamera> cameras = cameras_around(box, kSides, kElevation, kPhase, height);
  zoom_to_bodies(cameras, bodies, height);
  const int width = cameras[0].width;
  cv::Mat sheet(static_cast<int>(poses.size()) * height, kSides * width, CV_8UC3);
  TriangleMesh mesh = character.mesh;
  for (std::size_t row = 0; row < poses.size(); ++row) {
    mesh.vertices = bodies[row];
    ScanPainter painter(mesh);
    for (int side = 0; side < kSides; ++side) {
      cv::Mat image = painter.draw(cameras[static_cast<std::size_t>(side)]);
      if (side == 0) write_label(image, poses[row].name);
      image.copyTo(sheet(cv::Rect(side * width, static_cast<int>(row) * height, width, height)));
    }
  }
  return sheet;
}

}  // namespace doppel
