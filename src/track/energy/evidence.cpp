#include "doppel/track/energy/evidence.h"

#include <algorithm>

#include "doppel/core/as_size.h"

namespace doppel {

namespace {
constexpr double kNearestDepth = 0.05;  // metres
constexpr int kFinestWindow = 2;        // pixels of a window for each pixel of the image
}  // namespace

OutlineField::OutlineField(const cv::Mat& mask, int pixels, double margin) {
  const CropBox box = crop_of_mask(mask, margin);
  if (box.empty()) return;
  const int side = std::min(pixels, kFinestWindow * box.side);
  const cv::Mat window = crop_mask(mask, box, side);
  const int inside = cv::countNonZero(window);
  if (inside == 0 || inside == side * side) return;
  box_ = box;
  distance_ = signed_distance(window);
}

std::vector<OutlineField::Point> OutlineField::contour(int most) const {
  std::vector<Eigen::Vector2d> crossings;  // pixels of the window
  for (int row = 0; row < distance_.rows; ++row)
    for (int column = 0; column < distance_.cols; ++column)
      for (const auto& [down, right] : {std::pair(0, 1), std::pair(1, 0)}) {
        if (row + down >= distance_.rows || column + right >= distance_.cols) continue;
        const double here = distance_.at<float>(row, column), there = distance_.at<float>(row + down, column + right);
        if ((here < 0.0) == (there < 0.0)) continue;
        const double share = here / (here - there);
        crossings.emplace_back(column + 0.5 + share * right, row + 0.5 + share * down);
      }
  const double scale = box_.image_pixels_per_pixel(pixels());
  const std::size_t count = std::min(crossings.size(), as_size(most));
  std::vector<Point> points;
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector2d pixel = Eigen::Vector2d(box_.u0, box_.v0) + scale * crossings[i * crossings.size() / count];
    const Eigen::Vector2d way = at(pixel).gradient;
    if (way.norm() > 0.0) points.push_back({pixel, way.normalized()});
  }
  return points;
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
  Sample sample;
  sample.distance = scale * (top + fy * (bottom - top));
  sample.gradient = {(1.0 - fy) * (above[1] - above[0]) + fy * (below[1] - below[0]), bottom - top};
  if (wanted == inside) return sample;
  const Eigen::Vector2d way = wanted - inside;
  const double length = way.norm();
  sample.distance += scale * length;
  for (int i = 0; i < 2; ++i)
    if (way[i] != 0.0) sample.gradient[i] = way[i] / length;
  return sample;
}

std::optional<ProjectedPoint> project_with_jacobian(const PinholeCamera& camera, const Eigen::Vector3d& point) {
  const Eigen::Vector3d x = camera.camera_from_world(point);
  if (!(x.z() > kNearestDepth)) return std::nullopt;
  const double fx = camera.K(0, 0), skew = camera.K(0, 1), fy = camera.K(1, 1);
  const double a = x.x() / x.z(), b = x.y() / x.z();
  ProjectedPoint result;
  result.pixel = {fx * a + skew * b + camera.K(0, 2), fy * b + camera.K(1, 2)};
  const double nearness = 1.0 / x.z();
  result.jacobian.row(1) = nearness * fy * (camera.R.row(1) - b * camera.R.row(2));
  result.jacobian.row(0) =
      nearness * (fx * (camera.R.row(0) - a * camera.R.row(2)) + skew * (camera.R.row(1) - b * camera.R.row(2)));
  return result;
}

}  // namespace doppel
