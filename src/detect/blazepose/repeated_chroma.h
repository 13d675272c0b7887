#pragma once

#include <opencv2/core.hpp>

namespace doppel {

/// Video stores colour at half of the resolution, and decoders repeat each value in blocks of 2 x 2 pixels. Where this
/// is so, the chroma is interpolated between the centres of the blocks. An outline is then a quarter of a pixel more
/// accurate. Other images are returned unchanged. @param image 8-bit BGR
cv::Mat smooth_repeated_chroma(const cv::Mat& image);

}  // namespace doppel
