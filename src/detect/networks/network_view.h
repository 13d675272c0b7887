#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "doppel/detect/networks/network_options.h"

namespace doppel {

/// An upright rectangle in an image, pixels; the first pixel covers (0, 0) to (1, 1).
struct PersonBox {
  Eigen::Vector2d low = Eigen::Vector2d::Zero(), high = Eigen::Vector2d::Zero();
  double score = 1.0;

  Eigen::Vector2d centre() const { return 0.5 * (low + high); }
  Eigen::Vector2d size() const { return high - low; }
};

/// The upright rectangle of an image that a network sees. Positions in the image and in the network's input are
/// continuous: the centre of the first pixel is (0.5, 0.5) in both.
struct NetworkView {
  cv::Size input;          ///< pixels of the network's input
  Eigen::Vector2d origin;  ///< position in the image of the input's corner (0, 0)
  Eigen::Vector2d step;    ///< image pixels by input pixel

  /// origin + step * position
  Eigen::Vector2d image_from_input(const Eigen::Vector2d& position) const {
    return origin + step.cwiseProduct(position);
  }
};

/// The input size of a network for an image: `input`, or `input_height` and a width in the image's aspect ratio, both
/// rounded to multiples of 8.
cv::Size input_size(const NetworkOptions& options, cv::Size image);

/// The whole image: stretched to the input, or (`letterbox`) in the middle of it with equal scales.
NetworkView whole_view(const NetworkOptions& options, cv::Size image);
/// The smallest rectangle with the aspect ratio of the input around a box, times `padding`, with equal scales.
NetworkView crop_view(const PersonBox& box, double padding, cv::Size input);

/// The network's input for a view, [1, 3, h, w], 32-bit: (colour - mean) / deviation. Colours are interpolated between
/// pixel centres; where a pixel of the input covers several of the image, they are averaged before.
/// @param image 8-bit BGR
cv::Mat network_input(const cv::Mat& image, const NetworkView& view, const NetworkOptions& options);

/// A mask over the network's input as a mask of the image.
/// @param probability 32-bit, 0..1, of any size, which covers the input
/// @return 8-bit, probability * 255 rounded; 0 outside of the view
cv::Mat image_mask(const cv::Mat& probability, const NetworkView& view, cv::Size image);

}  // namespace doppel
