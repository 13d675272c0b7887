#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

namespace doppel {

/// Images side by side in one, each with a border of its own outermost pixels against bleeding.
class TextureAtlas {
 public:
  /// Images are made smaller, all by the same factor, until the atlas fits.
  /// @param images 8-bit BGR @param largest_side pixels
  /// @throws Error for so many images that even single pixels do not fit
  TextureAtlas(std::vector<cv::Mat> images, int largest_side);

  const cv::Mat& image() const { return image_; }
  /// The UV in the atlas of a UV in [0,1] of image `i`; u right, v up.
  Eigen::Vector2d place(std::size_t i, const Eigen::Vector2d& uv) const;

 private:
  bool pack(const std::vector<cv::Mat>& images, int width, int largest_side);

  cv::Mat image_;
  std::vector<cv::Rect> rectangles_;
};

}  // namespace doppel
