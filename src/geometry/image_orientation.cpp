#include "doppel/geometry/image_orientation.h"

#include <cstdint>

#include "doppel/geometry/number_at.h"

namespace doppel {

namespace {

constexpr std::string_view kExifHead("Exif\0\0", 6);

bool starts_with(std::string_view bytes, std::string_view head) { return bytes.substr(0, head.size()) == head; }

/// EXIF data are a TIFF file without image. JPEG, and some writers of WebP, put a head before them.
std::string_view behind_head(std::string_view exif) {
  return starts_with(exif, kExifHead) ? exif.substr(kExifHead.size()) : exif;
}

/// The segments before the pixels (SOS, 0xDA); XMP data are in a segment of the same kind.
std::string_view exif_of_jpeg(std::string_view bytes) {
  for (std::size_t at = 2; at + 4 <= bytes.size() && bytes[at] == '\xFF' && bytes[at + 1] != '\xDA';) {
    if (bytes[at + 1] == '\xFF') {
      ++at;  // padding
      continue;
    }
    const std::size_t length = number_at(bytes, at + 2, 2, true);
    const std::string_view segment = bytes.substr(at + 4, length < 2 ? 0 : length - 2);
    if (bytes[at + 1] == '\xE1' && starts_with(segment, kExifHead)) return segment;
    at += 2 + length;
  }
  return {};
}

/// PNG and WebP are lists of chunks, with length, name of four letters and data.
/// @param first of the chunks @param name_first whether the name comes before the length
/// @param round lengths are rounded up to a multiple of it @param tail bytes behind the data
std::string_view chunk(std::string_view bytes, std::string_view name, std::size_t first, bool big_endian,
                       bool name_first, std::size_t round, std::size_t tail) {
  for (std::size_t at = first; at + 8 <= bytes.size();) {
    const std::size_t length = number_at(bytes, at + (name_first ? 4 : 0), 4, big_endian);
    if (bytes.substr(at + (name_first ? 0 : 4), 4) == name) return bytes.substr(at + 8, length);
    at += 8 + (length + round - 1) / round * round + tail;
  }
  return {};
}

std::string_view exif_of(std::string_view bytes) {
  if (starts_with(bytes, "\xFF\xD8")) return exif_of_jpeg(bytes);
  if (starts_with(bytes, "\x89PNG\r\n\x1a\n")) return chunk(bytes, "eXIf", 8, true, false, 1, 4);
  if (starts_with(bytes, "RIFF") && bytes.substr(8, 4) == "WEBP") return chunk(bytes, "EXIF", 12, false, true, 2, 0);
  return {};
}

}  // namespace

int exif_orientation(std::string_view bytes) {
  constexpr std::uint64_t kOrientation = 0x0112;
  if (bytes.size() < 12) return 1;
  const std::string_view exif = behind_head(exif_of(bytes));
  const bool big = starts_with(exif, "MM");
  if (!big && !starts_with(exif, "II")) return 1;
  const std::size_t list = number_at(exif, 4, 4, big), count = number_at(exif, list, 2, big);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t entry = list + 2 + 12 * i;
    if (number_at(exif, entry, 2, big) != kOrientation) continue;
    const bool is_short = number_at(exif, entry + 2, 2, big) == 3;  // some write four bytes
    const std::uint64_t value = number_at(exif, entry + 8, is_short ? 2 : 4, big);
    return value >= 1 && value <= 8 ? static_cast<int>(value) : 1;
  }
  return 1;
}

cv::Mat as_shown(const cv::Mat& stored, int orientation) {
  cv::Mat upright = stored;
  if (orientation > 4) {  // 5 to 8 are 1 to 4, transposed before
    cv::transpose(stored, upright);
    orientation -= 4;
  }
  if (orientation == 1) return upright;
  cv::Mat flipped;
  cv::flip(upright, flipped, orientation == 2 ? 1 : orientation == 3 ? -1 : 0);
  return flipped;
}

}  // namespace doppel
