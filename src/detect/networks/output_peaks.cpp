#include "doppel/detect/networks/output_peaks.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace doppel {

namespace {

constexpr double kMinHeat = 1e-3;  ///< smaller values are noise; the logarithm would stress them

/// The maximum of a parabola through three neighbours, -0.5 to 0.5.
double parabola_peak(double before, double middle, double after) {
  const double curvature = before - 2.0 * middle + after;
  return curvature < 0.0 ? std::clamp(0.5 * (before - after) / curvature, -0.5, 0.5) : 0.0;
}

double quarter(double before, double after) { return before == after ? 0.0 : after > before ? 0.25 : -0.25; }

/// A heatmap around its largest entry; entries beyond the border repeat the border.
class Neighbours {
 public:
  Neighbours(const cv::Mat& heatmap, cv::Point at) : heatmap_(&heatmap), at_(at) {}
  double operator()(int dx, int dy) const {
    return heatmap_->at<float>(std::clamp(at_.y + dy, 0, heatmap_->rows - 1),
                               std::clamp(at_.x + dx, 0, heatmap_->cols - 1));
  }

 private:
  const cv::Mat* heatmap_;
  cv::Point at_;
};

/// The 5x5 entries around the peak of the blurred heatmap, as logarithms.
cv::Mat log_heat(const cv::Mat& heatmap, cv::Point at, int blur) {
  cv::Mat blurred = heatmap;
  if (blur > 1) cv::GaussianBlur(heatmap, blurred, {blur, blur}, 0.0, 0.0, cv::BORDER_CONSTANT);
  cv::Mat logs(3, 3, CV_32F);
  const Neighbours heat(blurred, at);
  for (int dy = -1; dy <= 1; ++dy)
    for (int dx = -1; dx <= 1; ++dx)
      logs.at<float>(dy + 1, dx + 1) = static_cast<float>(std::log(std::max(heat(dx, dy), kMinHeat)));
  return logs;
}

/// The step -H^-1 g to the maximum of the quadratic function with the derivatives of the logarithm, at most one entry.
Eigen::Vector2d dark_step(const cv::Mat& heatmap, cv::Point at, int blur) {
  const cv::Mat logs = log_heat(heatmap, at, blur);
  const Neighbours heat(logs, {1, 1});
  const Eigen::Vector2d gradient(0.5 * (heat(1, 0) - heat(-1, 0)), 0.5 * (heat(0, 1) - heat(0, -1)));
  const double xx = heat(1, 0) - 2.0 * heat(0, 0) + heat(-1, 0), yy = heat(0, 1) - 2.0 * heat(0, 0) + heat(0, -1);
  if (heatmap.rows == 1) return {xx < 0.0 ? std::clamp(-gradient.x() / xx, -1.0, 1.0) : 0.0, 0.0};  // a row of bins
  const double xy = 0.25 * (heat(1, 1) - heat(-1, 1) - heat(1, -1) + heat(-1, -1));
  const double determinant = xx * yy - xy * xy;
  if (!(xx < 0.0) || !(determinant > 1e-12)) return Eigen::Vector2d::Zero();  // no maximum
  const Eigen::Vector2d step = (Eigen::Matrix2d() << yy, -xy, -xy, xx).finished() * -gradient / determinant;
  return step.cwiseMax(-1.0).cwiseMin(1.0);
}

Eigen::Vector2d refined_step(const cv::Mat& heatmap, cv::Point at, PeakRefinement refine, int blur) {
  const Neighbours heat(heatmap, at);
  switch (refine) {
    case PeakRefinement::none:
      break;
    case PeakRefinement::quarter:
      return {quarter(heat(-1, 0), heat(1, 0)), quarter(heat(0, -1), heat(0, 1))};
    case PeakRefinement::parabola:
      return {parabola_peak(heat(-1, 0), heat(0, 0), heat(1, 0)), parabola_peak(heat(0, -1), heat(0, 0), heat(0, 1))};
    case PeakRefinement::dark:
      return dark_step(heatmap, at, blur);
  }
  return Eigen::Vector2d::Zero();
}

}  // namespace

double grid_position(double index, int count, int pixels, OutputGrid grid) {
  switch (grid) {
    case OutputGrid::cells:
      break;
    case OutputGrid::samples:
      return index * pixels / count + 0.5;
    case OutputGrid::ends:
      return count > 1 ? index * (pixels - 1) / (count - 1) + 0.5 : 0.5 * pixels;
  }
  return (index + 0.5) * pixels / count;
}

NetworkPoint find_peak(const cv::Mat& heatmap, PeakRefinement refine, int blur, double threshold) {
  double value = 0.0;
  cv::Point at;
  cv::minMaxLoc(heatmap, nullptr, &value, nullptr, &at);
  if (!(value >= threshold)) return {};
  return {Eigen::Vector2d(at.x, at.y) + refined_step(heatmap, at, refine, blur), std::min(value, 1.0)};
}

}  // namespace doppel
