#include "doppel/track/evidence.h"

#include <algorithm>

namespace doppel {

namespace {
constexpr double kNearestDepth = 0.05;  // metres
}

OutlineField::OutlineField(const cv::Mat& mask, int pixels, double margin) {
  const CropBox box = crop_of_mask(mask, margin);
  if (box.empty()) return;
  const cv::Mat window = crop_mask(mask, box, pixels);
  const int inside = cv::countNonZero(window);
  if (inside == 0 || inside == pixels * pixels) return;
  box_ = box;
  distance_ = signed_distance(window);
}

OutlineField::Sample OutlineField::at(const Eigen::Vector2d& pixel) const {
  const double scale = box_.image_pixels_per_pixel(pixels()), last = pixels() - 1.0;
  const Eigen::Vector2d wanted = (pixel - Eigen::Vector2d(box_.u0, box_.v0)) / scale - Eigen::Vector2d(0.5, 0.5);
  const Eigen::Vector2d inside = wanted.cwiseMax(0.0).cwiseMin(last);
  const int column = std::min(static_cast<int>(inside.x()), pixels() - 2);
  const int row = std::min(static_cast<int>(inside.y()), pixels() - 2);
  const double fx = inside.x() - column, fy = inside.y() - row;
  const float* above = distance_.ptr<float>(row) + column;
  const float* below = distance_.ptr<float>(row + 1) + column;
  const double top = above[0] + fx * (above[1] - above[0]), bottom = below[0] + fx * (below[1] - below[0]);
  const Eigen::Vector2d way = wanted - inside;
  const double length = way.norm();
  Sample sample;
  sample.distance = scale * (top + fy * (bottom - top) + length);
  sample.gradient = {(1.0 - fy) * (above[1] - above[0]) + fy * (below[1] - below[0]), bottom - top};
  for (int i = 0; i < 2; ++i)
    if (way[i] != 0.0) sample.gradient[i] = way[i] / length;
  return sample;
}

std::optional<ProjectedPoint> project_with_slope(const Camera& camera, const Eigen::Vector3d& point) {
  const Eigen::Vector3d x = camera.camera_from_world(point);
  if (!(x.z() > kNearestDepth)) return std::nullopt;
  const double fx = camera.K(0, 0), skew = camera.K(0, 1), fy = camera.K(1, 1);
  const double a = x.x() / x.z(), b = x.y() / x.z();
  ProjectedPoint result;
  result.pixel = {fx * a + skew * b + camera.K(0, 2), fy * b + camera.K(1, 2)};
  Eigen::Matrix<double, 2, 3> in_camera;
  in_camera << fx, skew, -(fx * a + skew * b), 0.0, fy, -fy * b;
  result.slope = in_camera / x.z() * camera.R;
  return result;
}

}  // namespace doppel
