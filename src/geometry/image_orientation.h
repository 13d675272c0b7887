#pragma once

#include <opencv2/core.hpp>
#include <string_view>

namespace doppel {

/// The orientation that the EXIF data of a JPEG, PNG or WebP file state: 1 to 8, as numbered by EXIF; 1, as stored,
/// where they state none. Damaged data state none. A TIFF file counts as stored, because OpenCV turns it when it
/// decodes it.
/// @param bytes of the whole file
int exif_orientation(std::string_view bytes);

/// An image as it is to be shown. @param stored of any type @param orientation 1 to 8, as numbered by EXIF
cv::Mat as_shown(const cv::Mat& stored, int orientation);

}  // namespace doppel
