#include "doppel/track/energy/drawn_outline.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace doppel {

DrawnOutline::DrawnOutline(const cv::Mat& covered) : covered_(covered) {
  cv::erode(covered, inner_, cv::Mat::ones(3, 3, CV_8U));
}

bool DrawnOutline::holds(double u, double v) const {
  const int pixels = covered_.cols;
  return u >= 1.0 && v >= 1.0 && u < pixels - 1 && v < pixels - 1 &&
         inner_.at<unsigned char>(static_cast<int>(v), static_cast<int>(u)) == 0;
}

double DrawnOutline::distance(double u, double v) const {
  const int pixels = covered_.cols;
  const double x = u - 0.5, y = v - 0.5;
  const int column = std::min(static_cast<int>(x), pixels - 2), row = std::min(static_cast<int>(y), pixels - 2);
  const double fx = x - column, fy = y - row;
  const auto at = [&](int down, int right) { return distance_of_pixel(column + right, row + down); };
  return (1.0 - fy) * ((1.0 - fx) * at(0, 0) + fx * at(0, 1)) + fy * ((1.0 - fx) * at(1, 0) + fx * at(1, 1));
}

/// The distance to the nearest pixel on the other side, less half a pixel. Exact for pixels that have one of the other
/// side among the 5x5 around them.
double DrawnOutline::distance_of_pixel(int column, int row) const {
  const bool inside = is_covered(column, row);
  const int last = covered_.cols - 1;
  int nearest = 9;  // squared
  for (int y = std::max(0, row - 2); y <= std::min(last, row + 2); ++y)
    for (int x = std::max(0, column - 2); x <= std::min(last, column + 2); ++x)
      if (is_covered(x, y) != inside) nearest = std::min(nearest, (x - column) * (x - column) + (y - row) * (y - row));
  const double distance = std::sqrt(static_cast<double>(nearest)) - 0.5;
  return inside ? -distance : distance;
}

}  // namespace doppel
