#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

namespace doppel {

/// An image at several levels of blur: the pyramid of (4.9). The fit begins with the most blurred image, whose
/// gradients reach farther, and continues with sharper ones. The thesis names the sizes of the blur kernels, not the
/// size of the images: they keep the size of the image, or each level has half the sides of the next.
class ColourPyramid {
 public:
  ColourPyramid() = default;
  /// @param image 8-bit BGR @param window the part of the image that `at` covers
  /// @param kernels sizes of the Gaussian kernels in pixels, odd, coarse to fine (thesis: 15, 9, 3)
  /// @param halve each level has half the sides of the next one; the last has those of the image. The window then loses
  /// up to seven pixels on the right and below.
  ColourPyramid(const cv::Mat& image, const cv::Rect& window, const std::vector<int>& kernels, bool halve = false);

  int num_levels() const { return static_cast<int>(levels_.size()); }

  struct Sample {
    Eigen::Vector3d colour;                ///< RGB 0..1
    Eigen::Matrix<double, 3, 2> jacobian;  ///< d colour / d (u, v), per pixel of the image
  };
  /// Bilinear interpolation. @param pixel of the image @param sample the result @return false outside of the window
  bool at(int level, const Eigen::Vector2d& pixel, Sample& sample) const;

 private:
  cv::Rect window_;
  struct Level {
    cv::Mat image;                          ///< float RGB 0..1 of the window
    double shrink_x = 1.0, shrink_y = 1.0;  ///< pixels of the image per pixel of the level
  };
  std::vector<Level> levels_;
};

}  // namespace doppel
