#include "doppel/calibration/estimation/outline_tracks.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "doppel/calibration/estimation/epipolar.h"
#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kSmoothing = 0.5;  // pixels; an edge stays in its place, its steps go
constexpr double kHalf = 127.5;
constexpr double kBorder = 2.0;      // pixels
constexpr double kMinAcross = 0.1;   // sine of the angle between a ray and the baseline
constexpr double kMinTurn = 0.2;     // length of the mean viewing direction across the baseline
constexpr double kMaxPencil = 0.17;  // cosine of 80 degrees

/// The crossings of one half along the rows of an image, the first and the last of each row. x and y are exchanged if
/// `transposed`.
void add_crossings(const cv::Mat_<float>& image, bool transposed, std::vector<cv::Point2f>& points) {
  const auto add = [&](int row, double at) {
    const auto across = static_cast<float>(row + 0.5), along = static_cast<float>(at + 0.5);
    points.push_back(transposed ? cv::Point2f(across, along) : cv::Point2f(along, across));
  };
  for (int row = 0; row < image.rows; ++row) {
    const float* v = image[row];
    int first = 0, last = image.cols - 1;
    while (first <= last && v[first] < kHalf) ++first;
    if (first > last) continue;
    while (v[last] < kHalf) --last;
    const auto between = [&](int outside, int inside) {
      return outside + (inside - outside) * (kHalf - v[outside]) / (v[inside] - v[outside]);
    };
    add(row, first == 0 ? -0.5 : between(first - 1, first));
    add(row, last == image.cols - 1 ? last + 0.5 : between(last + 1, last));
  }
}

}  // namespace

Outline outline_of(const cv::Mat& mask, const Camera& camera) {
  cv::Mat_<float> smooth;
  mask.convertTo(smooth, CV_32F);
  cv::GaussianBlur(smooth, smooth, {}, kSmoothing, kSmoothing, cv::BORDER_REPLICATE);
  std::vector<cv::Point2f> points, hull;
  add_crossings(smooth, false, points);
  add_crossings(smooth.t(), true, points);
  Outline outline;
  if (points.empty()) return outline;
  cv::convexHull(points, hull);
  for (const cv::Point2f& corner : hull) {
    const bool on_border = corner.x < kBorder || corner.y < kBorder ||
                           corner.x > static_cast<float>(mask.cols) - kBorder ||
                           corner.y > static_cast<float>(mask.rows) - kBorder;
    outline.hull.push_back({filmed_pixel(camera, {corner.x, corner.y}), on_border});
  }
  return outline;
}

FrontierFinder::FrontierFinder(const Camera& a, const Camera& b) : cameras_{&a, &b} {
  const Vector3d along = (b.centre() - a.centre()).normalized();
  const Vector3d looking = (a.R.row(2) + b.R.row(2)).transpose() / 2.0;
  const Vector3d towards = looking - along * along.dot(looking);
  usable_ = towards.norm() >= kMinTurn;
  Eigen::Matrix3d pencil;
  pencil.row(0) = towards.normalized();
  pencil.row(1) = along.cross(towards).normalized();
  pencil.row(2) = along;
  for (std::size_t which = 0; which < 2; ++which)
    pencil_from_pixel_[which] = pencil * cameras_[which]->R.transpose() * cameras_[which]->K.inverse();
}

void check_outlines(const std::vector<Camera>& cameras, const std::vector<OutlineTrack>& outlines,
                    const std::string& purpose) {
  if (!outlines.empty() && outlines.size() != cameras.size())
    fail<UsageError>("{}: there are outlines of {} cameras, and {} cameras", purpose, outlines.size(), cameras.size());
}

std::optional<Vector2d> FrontierFinder::tangent(int which, const Outline& outline, int side) const {
  const Camera& camera = *cameras_[which];
  const Outline::Corner* best = nullptr;
  double extreme = 0.0;
  for (const Outline::Corner& corner : outline.hull) {
    const auto straight = straight_pixel(camera, corner.pixel);
    if (!straight) return std::nullopt;
    const Vector3d ray = (pencil_from_pixel_[which] * straight->homogeneous()).normalized();
    const double across = std::hypot(ray.x(), ray.y());
    if (across < kMinAcross || ray.x() < kMaxPencil * across) return std::nullopt;
    const double slope = (side == 0 ? -1.0 : 1.0) * ray.y() / ray.x();
    if (best != nullptr && slope <= extreme) continue;
    best = &corner;
    extreme = slope;
  }
  if (best == nullptr || best->on_border) return std::nullopt;
  return best->pixel;
}

std::optional<Vector2d> FrontierFinder::find(int which, const OutlineTrack& outlines, double frame, int side) const {
  const double before = std::floor(frame), share = frame - before;
  if (!usable_ || before < 0.0 || before + (share > 0.0 ? 1.0 : 0.0) >= static_cast<double>(outlines.size()))
    return std::nullopt;
  const auto first = tangent(which, outlines[before], side);
  if (!first || share == 0.0) return first;
  const auto second = tangent(which, outlines[as_size(before) + 1], side);
  if (!second) return std::nullopt;
  return Vector2d((1.0 - share) * *first + share * *second);
}

}  // namespace doppel
