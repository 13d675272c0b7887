#pragma once

#include <opencv2/core.hpp>
#include <span>

#include "doppel/detect/blazepose/roi.h"

namespace doppel {

/// @throws UsageError unless the image is 8-bit BGR, not empty
void require_image(const cv::Mat& image);

/// The square with the image's longer side around the image's centre.
struct Letterbox {
  double side = 0.0, left = 0.0, top = 0.0;  ///< pixels of the image; left and top are 0 or negative
};
Letterbox letterbox_of(cv::Size image);

/// The letterbox, resampled to pixels x pixels: bilinear, without smoothing. Outside of the image it is black.
/// @param image 8-bit BGR
/// @param result [pixels, pixels, RGB], -1 to 1
void sample_letterbox(const cv::Mat& image, int pixels, std::span<float> result);

/// A region of the image, resampled to pixels x pixels: bilinear, without smoothing. Outside of the image its border
/// pixels are repeated.
/// @param roi valid
/// @param result [pixels, pixels, RGB], 0 to 1
void sample_roi(const cv::Mat& image, const BodyRoi& roi, int pixels, std::span<float> result);

}  // namespace doppel
