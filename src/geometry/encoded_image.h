#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <string>

namespace doppel {

/// The most pixels of an image that is decoded: 16,384 x 16,384, or 0.8 GB of 8-bit colours. Some kilobytes of a PNG
/// file may announce more.
inline constexpr std::int64_t kMaxImagePixels = std::int64_t{1} << 28;

/// Width and height that the header of a PNG, JPEG, WebP, BMP or TIFF file announces; nothing for other bytes.
std::optional<Eigen::Vector2i> announced_image_size(const std::string& bytes);

/// Decodes the bytes of an image file. Decoders allocate what a header announces, so the header is looked at first.
/// @param flags of cv::imdecode
/// @return empty: no image, damaged, over a gigabyte, or with more pixels than allowed. Formats whose header is not
/// known here (announced_image_size) have OpenCV's own limit of 2^30 pixels
cv::Mat decode_image(const std::string& bytes, int flags, std::int64_t max_pixels = kMaxImagePixels);

}  // namespace doppel
