#pragma once

#include <opencv2/core.hpp>

namespace doppel {

/// Connected components of masks (8-bit, 0 or 255).

/// Only the largest 8-connected component of a mask.
cv::Mat largest_component(const cv::Mat& mask);
/// The 8-connected components of a mask that have a pixel on another mask.
cv::Mat components_touching(const cv::Mat& mask, const cv::Mat& other);
/// Fills the 4-connected components of the background that have at most `largest` pixels, those at the border of the
/// image too.
void fill_holes(cv::Mat& mask, int largest);

}  // namespace doppel
