#include "doppel/fit/surface/colour_pyramid.h"

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "doppel/core/as_size.h"

namespace doppel {

ColourPyramid::ColourPyramid(const cv::Mat& image, const cv::Rect& window, const std::vector<int>& kernels, bool halve)
    : window_(window & cv::Rect({}, image.size())) {
  if (window_.width < 2 || window_.height < 2) return;
  cv::Mat colours;
  cv::cvtColor(image(window_), colours, cv::COLOR_BGR2RGB);
  colours.convertTo(colours, CV_32FC3, 1.0 / 255.0);
  for (std::size_t level = 0; level < kernels.size(); ++level) {
    cv::Mat reduced = colours;
    for (std::size_t i = level + 1; halve && i < kernels.size() && reduced.cols >= 4 && reduced.rows >= 4; ++i) {
      cv::Mat half;
      cv::resize(reduced, half, {(reduced.cols + 1) / 2, (reduced.rows + 1) / 2}, 0.0, 0.0, cv::INTER_AREA);
      reduced = half;
    }
    levels_.push_back(
        {{}, static_cast<double>(colours.cols) / reduced.cols, static_cast<double>(colours.rows) / reduced.rows});
    const int size = kernels[level];
    cv::GaussianBlur(reduced, levels_.back().image, {size, size}, 0.0, 0.0, cv::BORDER_REPLICATE);
  }
}

bool ColourPyramid::at(int level, const Eigen::Vector2d& pixel, Sample& sample) const {
  const auto& [image, shrink_x, shrink_y] = levels_[as_size(level)];
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
