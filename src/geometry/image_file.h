#pragma once

#include <filesystem>
#include <opencv2/core.hpp>

namespace doppel {

/// Writes an image in the format of the extension (.png, .jpg). The file appears complete or not at all.
/// @param image CV_8UC1, CV_8UC3 (BGR) or CV_8UC4 @throws Error when the image cannot be encoded or written
void write_image(const std::filesystem::path& path, const cv::Mat& image);

}  // namespace doppel
