#pragma once

#include <filesystem>
#include <opencv2/core.hpp>

namespace doppel {

/// Reads an image as every viewer shows it: turned as its EXIF data say (image_orientation.h). Images that are compared
/// with what a camera filmed are read by this function or the next; textures are not, because their coordinates belong
/// to the pixels as stored.
/// @return channels and bits as in the file, colours as BGR or BGRA
/// @throws FileError when the file is missing, is no image that OpenCV can decode, or has more than kMaxImagePixels
cv::Mat read_image(const std::filesystem::path& path);
/// As read_image. @return CV_8UC3 (BGR), without alpha channel @throws FileError also for other than 8 or 16 bits
cv::Mat read_colour_image(const std::filesystem::path& path);

/// An image of any number of channels as 8-bit BGR; an alpha channel is left out. @pre CV_8U or CV_16U
cv::Mat to_colour(const cv::Mat& image);

/// Writes an image in the format of the extension (.png, .jpg). The file appears complete or not at all.
/// @param image CV_8UC1, CV_8UC3 (BGR) or CV_8UC4 @throws Error when the image cannot be encoded or written
void write_image(const std::filesystem::path& path, const cv::Mat& image);

}  // namespace doppel
