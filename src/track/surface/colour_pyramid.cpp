#include "doppel/track/surface/colour_pyramid.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace doppel {

ColourPyramid::ColourPyramid(const cv::Mat& image, const cv::Rect& window, const std::vector<int>& kernels, bool halve)
    : window_(window & cv::Rect({}, image.size())) {
  if (window_.width < 2 || window_.height < 2) return;
  if (halve && !kernels.empty()) {  // even sides, which OpenCV halves several times as fast as others
    const int multiple = 1 << (std::min<std::size_t>(kernels.size(), 4) - 1);
    if (window_.width >= multiple) window_.width -= window_.width % multiple;
    if (window_.height >= multiple) window_.height -= window_.height % multiple;
  }
  cv::Mat colours;
  cv::cvtColor(image(window_), colours, cv::COLOR_BGR2RGB);
  colours.convertTo(colours, CV_32FC3, 1.0 / 255.0);
  cv::Mat reduced = colours;
  levels_.resize(kernels.size());
  for (std::size_t level = kernels.size(); level-- > 0;) {
    Level& made = levels_[level];
    made.shrink_x = static_cast<double>(colours.cols) / reduced.cols;
    made.shrink_y = static_cast<double>(colours.rows) / reduced.rows;
    const int size = kernels[level];
    cv::GaussianBlur(reduced, made.image, {size, size}, 0.0, 0.0, cv::BORDER_REPLICATE);
    if (!halve || level == 0 || reduced.cols < 4 || reduced.rows < 4) continue;
    cv::Mat half;
    cv::resize(reduced, half, {(reduced.cols + 1) / 2, (reduced.rows + 1) / 2}, 0.0, 0.0, cv::INTER_AREA);
    reduced = half;
  }
}

bool ColourPyramid::at(int level, const Eigen::Vector2d& pixel, Sample& sample) const {
  const auto& [image, shrink_x, shrink_y] = levels_[level];
  const double x = (pixel.x() - window_.x) / shrink_x - 0.5, y = (pixel.y() - window_.y) / shrink_y - 0.5;
  if (!(x >= 0.0 && y >= 0.0 && x < image.cols - 1 && y < image.rows - 1)) return false;
  const int column = static_cast<int>(x), row = static_cast<int>(y);
  const double fx = x - column, fy = y - row;
  const cv::Vec3f* above = image.ptr<cv::Vec3f>(row) + column;
  const cv::Vec3f* below = image.ptr<cv::Vec3f>(row + 1) + column;
  for (int c = 0; c < 3; ++c) {
    const double left = above[0][c], right = above[1][c], lower_left = below[0][c], lower_right = below[1][c];
    const double top = left + fx * (right - left), bottom = lower_left + fx * (lower_right - lower_left);
    sample.colour[c] = top + fy * (bottom - top);
    sample.jacobian(c, 0) = ((1.0 - fy) * (right - left) + fy * (lower_right - lower_left)) / shrink_x;
    sample.jacobian(c, 1) = (bottom - top) / shrink_y;
  }
  return true;
}

}  // namespace doppel
