#pragma once

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "support/number_bytes.h"
#include "support/png_writer.h"

/// Image files whose EXIF data turn them, byte by byte, so that no reader of EXIF data is needed.
namespace doppel::support {

/// The pixels to be stored so that a viewer that obeys `orientation` shows `shown`. By the words of the EXIF standard:
/// which side of the shown image the first row and the first column of the stored one are.
inline cv::Mat stored_for(const cv::Mat& shown, int orientation) {
  static const char* const kRowAndColumn[] = {"tl", "tr", "br", "bl", "lt", "rt", "rb", "lb"};
  const char row_side = kRowAndColumn[orientation - 1][0], column_side = kRowAndColumn[orientation - 1][1];
  const bool upright = row_side == 't' || row_side == 'b';
  cv::Mat stored(upright ? shown.size() : cv::Size(shown.rows, shown.cols), shown.type());
  const auto coordinate = [&](char side, int steps) {  // that many steps away from a side of the shown image
    return side == 'r' ? shown.cols - 1 - steps : side == 'b' ? shown.rows - 1 - steps : steps;
  };
  const std::size_t pixel = shown.elemSize();
  for (int r = 0; r < stored.rows; ++r)
    for (int c = 0; c < stored.cols; ++c) {
      const int along_row = coordinate(row_side, r), along_column = coordinate(column_side, c);
      const int y = upright ? along_row : along_column, x = upright ? along_column : along_row;
      std::copy_n(shown.ptr(y) + x * pixel, pixel, stored.ptr(r) + c * pixel);
    }
  return stored;
}

/// EXIF data that state an orientation, behind the tag of the camera's maker.
inline std::string exif_data(int orientation, bool big_endian) {
  const auto number = [&](std::uint64_t value, int width) { return number_bytes(value, width, big_endian); };
  return (big_endian ? "MM" : "II") + number(42, 2) + number(8, 4) + number(2, 2) +
         /* 'DOP' */ number(0x010f, 2) + number(2, 2) + number(4, 4) + std::string("DOP\0", 4) +
         /* turned */ number(0x0112, 2) + number(3, 2) + number(1, 4) + number(orientation, 2) + number(0, 2) +
         number(0, 4);
}

/// The file of an image that is shown as `shown`. @param extension .jpg, .png or .webp
inline std::string oriented_file(const cv::Mat& shown, const std::string& extension, int orientation,
                                 bool big_endian = true) {
  const cv::Mat stored = stored_for(shown, orientation);
  std::vector<unsigned char> encoded;
  cv::imencode(extension, stored, encoded, {cv::IMWRITE_JPEG_QUALITY, 100, cv::IMWRITE_WEBP_QUALITY, 101});
  std::string bytes(encoded.begin(), encoded.end());
  const std::string exif = exif_data(orientation, big_endian);
  if (extension == ".jpg") {
    const std::string segment = std::string("Exif\0\0", 6) + exif;
    return bytes.insert(2, "\xFF\xE1" + number_bytes(segment.size() + 2, 2, true) + segment);
  }
  if (extension == ".png") return bytes.insert(33, png_chunk("eXIf", exif));  // behind the head
  if (extension != ".webp") throw std::runtime_error("no EXIF data are written for " + extension);
  const int flags = 0x08 | (stored.channels() == 4 ? 0x10 : 0);  // EXIF data, alpha channel
  const std::string head = "VP8X" + number_bytes(10, 4, false) + number_bytes(flags, 4, false) +
                           number_bytes(stored.cols - 1, 3, false) + number_bytes(stored.rows - 1, 3, false);
  const std::string tail = "EXIF" + number_bytes(exif.size(), 4, false) + exif;
  const std::string chunks = "WEBP" + head + bytes.substr(12) + tail;
  return "RIFF" + number_bytes(chunks.size(), 4, false) + chunks;
}

}  // namespace doppel::support
