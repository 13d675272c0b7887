#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <utility>

namespace doppel {

/// The outline of a surface that is drawn in a window.
class DrawnOutline {
 public:
  /// @param covered 8-bit, square, other than 0 where the surface is drawn; its pixels are shared
  explicit DrawnOutline(cv::Mat covered) : covered_(std::move(covered)) {}

  /// Signed distance to the outline, pixels of the window, - inside. Interpolated like `OutlineField`, so that a
  /// surface that covers exactly a mask has the same distances. Nothing for a point that is not on the outline: when
  /// the surface covers all of the 3x3 pixels around it, or when it lies within one pixel of the window's border or
  /// beyond.
  /// @param u, v pixels of the window
  std::optional<double> distance(double u, double v) const;

 private:
  bool is_covered(int column, int row) const { return covered_.at<unsigned char>(row, column) != 0; }
  bool has_gap_around(int column, int row) const;
  double distance_of_pixel(int column, int row) const;

  cv::Mat covered_;
};

}  // namespace doppel
