#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

namespace doppel {

/// An image at several levels of blur: the pyramid of (4.9). The fit begins with the most blurred image, whose
/// gradients reach farther, and continues with sharper ones.
class ColourPyramid {
 public:
  ColourPyramid() = default;
  /// @param image 8-bit BGR @param window the part of the image that `at` covers
  /// @param kernels sizes of the Gaussian kernels in pixels, odd, coarse to fine (thesis: 15, 9, 3)
  ColourPyramid(const cv::Mat& image, const cv::Rect& window, const std::vector<int>& kernels);

  int num_levels() const { return static_cast<int>(levels_.size()); }

  struct Sample {
    Eigen::Vector3d colour;                ///< RGB 0..1
    Eigen::Matrix<double, 3, 2> jacobian;  ///< d colour / d (u, v)
  };
  /// Bilinear interpolation. @param pixel of the image @param sample the result @return false outside of the window
  bool at(int level, const Eigen::Vector2d& pixel, Sample& sample) const;

 private:
  cv::Rect window_;
  std::vector<cv::Mat> levels_;  ///< float RGB 0..1 of the window
};

}  // namespace doppel
