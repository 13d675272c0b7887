#include "doppel/geometry/encoded_image.h"

#include <algorithm>
#include <array>
#include <opencv2/imgcodecs.hpp>
#include <string_view>

#include "doppel/geometry/number_at.h"

namespace doppel {

namespace {

constexpr std::size_t kMaxEncodedBytes = std::size_t{1} << 30;

Eigen::Vector2i size_of(std::uint64_t width, std::uint64_t height) {
  constexpr std::uint64_t kMaxSide = 1 << 30;
  return {static_cast<int>(std::min(width, kMaxSide)), static_cast<int>(std::min(height, kMaxSide))};
}

/// The frame header (SOF) of a JPEG file behind its other segments.
std::optional<Eigen::Vector2i> jpeg_size(std::string_view bytes) {
  for (std::size_t at = 2; at + 9 <= bytes.size();) {
    if (bytes[at] != '\xFF') return std::nullopt;
    const auto kind = static_cast<unsigned char>(bytes[at + 1]);
    if (kind == 0xFF) {
      ++at;  // padding
    } else if (kind >= 0xC0 && kind <= 0xCF && kind != 0xC4 && kind != 0xC8 && kind != 0xCC) {
      return size_of(number_at(bytes, at + 7, 2, true), number_at(bytes, at + 5, 2, true));
    } else {
      at += 2 + number_at(bytes, at + 2, 2, true);
    }
  }
  return std::nullopt;
}

std::optional<Eigen::Vector2i> webp_size(std::string_view bytes) {
  const std::string_view form = bytes.substr(12, 4);
  if (form == "VP8X") return size_of(number_at(bytes, 24, 3, false) + 1, number_at(bytes, 27, 3, false) + 1);
  if (form == "VP8 ") return size_of(number_at(bytes, 26, 2, false) & 0x3FFF, number_at(bytes, 28, 2, false) & 0x3FFF);
  if (form != "VP8L") return std::nullopt;
  const std::uint64_t bits = number_at(bytes, 21, 4, false);
  return size_of((bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1);
}

/// Width and height are the tags 256 and 257 of the first list of tags.
std::optional<Eigen::Vector2i> tiff_size(std::string_view bytes) {
  const bool big = bytes[0] == 'M';
  const std::size_t list = number_at(bytes, 4, 4, big), count = number_at(bytes, list, 2, big);
  std::array<std::uint64_t, 2> found{};
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t entry = list + 2 + 12 * i, tag = number_at(bytes, entry, 2, big);
    if (tag == 256 || tag == 257)
      found[tag - 256] = number_at(bytes, entry + 8, number_at(bytes, entry + 2, 2, big) == 3 ? 2 : 4, big);
  }
  return size_of(found[0], found[1]);
}

}  // namespace

std::optional<Eigen::Vector2i> announced_image_size(const std::string& bytes) {
  if (bytes.size() < 30) return std::nullopt;
  const std::string_view view = bytes;
  if (view.substr(0, 8) == "\x89PNG\r\n\x1a\n")
    return size_of(number_at(view, 16, 4, true), number_at(view, 20, 4, true));
  if (view.substr(0, 2) == "\xFF\xD8") return jpeg_size(view);
  if (view.substr(0, 4) == "RIFF" && view.substr(8, 4) == "WEBP") return webp_size(view);
  if (view.substr(0, 4) == std::string_view("II*\0", 4) || view.substr(0, 4) == std::string_view("MM\0*", 4))
    return tiff_size(view);
  if (view.substr(0, 2) != "BM") return std::nullopt;
  if (number_at(view, 14, 4, false) == 12)  // the header of OS/2
    return size_of(number_at(view, 18, 2, false), number_at(view, 20, 2, false));
  // The height of a BMP image is negative where its first row is the upper one.
  const auto height = static_cast<std::int32_t>(number_at(view, 22, 4, false));
  return size_of(number_at(view, 18, 4, false),
                 static_cast<std::uint64_t>(std::abs(static_cast<std::int64_t>(height))));
}

cv::Mat decode_image(const std::string& bytes, int flags, std::int64_t max_pixels) {
  if (bytes.empty() || bytes.size() > kMaxEncodedBytes) return {};
  if (const auto size = announced_image_size(bytes);
      size && (size->minCoeff() < 1 || std::int64_t{size->x()} * size->y() > max_pixels))
    return {};
  const cv::Mat encoded(1, static_cast<int>(bytes.size()), CV_8U, const_cast<char*>(bytes.data()));
  try {
    return cv::imdecode(encoded, flags);
  } catch (const cv::Exception&) {
    return {};
  }
}

}  // namespace doppel
