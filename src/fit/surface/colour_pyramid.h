#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

namespace doppel {

/// An image blurred more and less: the pyramid of (4.9). The surface is first led by the blurred image, whose jacobian
/// reach farther, and then by finer ones.
class ColourPyramid {
 public:
  ColourPyramid() = default;
  /// @param image 8-bit BGR; @param window the part of it that will be asked for; @param kernels sizes of the
  /// Gaussian kernels in pixels, odd, coarse to fine (the thesis has 15, 9, 3)
  ColourPyramid(const cv::Mat& image, const cv::Rect& window, const std::vector<int>& kernels);

  int num_levels() const { return static_cast<int>(levels_.size()); }

  struct Sample {
    Eigen::Vector3d colour;             ///< RGB 0..1
    Eigen::Matrix<double, 3, 2> jacobian;  ///< d colour / d (u, v)
  };
  /// Bilinear. @param pixel of the image @param sample what is found @return false outside of the window
  bool at(int level, const Eigen::Vector2d& pixel, Sample& sample) const;

 private:
  cv::Rect window_;
  std::vector<cv::Mat> levels_;  ///< float RGB 0..1 of the window
};

}  // namespace doppel
