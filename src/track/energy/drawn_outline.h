#pragma once

#include <opencv2/core.hpp>

namespace doppel {

/// The outline of a surface that is drawn in a window.
class DrawnOutline {
 public:
  /// @param covered 8-bit, square, other than 0 where the surface is drawn; its pixels are shared
  explicit DrawnOutline(const cv::Mat& covered);

  /// Whether a point is on the outline: it lies in the window, more than a pixel from the border, and the surface
  /// leaves one of the 3x3 pixels around the point uncovered. @param u, v pixels of the window
  bool holds(double u, double v) const;
  /// Signed distance to the outline, pixels of the window, - inside. Interpolated like `OutlineField`, so that a
  /// surface that covers exactly a mask has the same distances. @pre holds(u, v)
  double distance(double u, double v) const;

 private:
  bool is_covered(int column, int row) const { return covered_.at<unsigned char>(row, column) != 0; }
  double distance_of_pixel(int column, int row) const;

  cv::Mat covered_;
  cv::Mat inner_;  ///< other than 0 where the surface covers all of the 3x3 pixels
};

}  // namespace doppel
