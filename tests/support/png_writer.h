#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "support/number_bytes.h"

/// PNG files of the kinds that OpenCV reads, but does not write: palettes, few bits, grey with alpha.
namespace doppel::support {

inline std::string png_chunk(const std::string& name, const std::string& data) {
  std::uint32_t sum = ~0u;
  for (const char c : name + data) {
    sum ^= static_cast<unsigned char>(c);
    for (int bit = 0; bit < 8; ++bit) sum = sum >> 1 ^ (sum & 1 ? 0xedb88320u : 0u);
  }
  return number_bytes(data.size(), 4, true) + name + data + number_bytes(~sum, 4, true);
}

/// A PNG file. @param colour_type as numbered by PNG: 0 grey, 2 RGB, 3 palette, 4 grey and alpha, 6 RGBA
/// @param rows of the packed samples @param palette chunks between head and pixels
inline std::string png_file(int width, int bits, int colour_type, const std::vector<std::string>& rows,
                            const std::string& palette = "") {
  std::string pixels;
  for (const std::string& row : rows) pixels += '\0' + row;  // without filter
  std::uint32_t a = 1, b = 0;
  for (const char c : pixels) {
    a = (a + static_cast<unsigned char>(c)) % 65521;
    b = (b + a) % 65521;
  }
  const std::string stored = "\x78\x01\x01" + number_bytes(pixels.size(), 2, false) +
                             number_bytes(~pixels.size() & 0xffff, 2, false) + pixels +
                             number_bytes(b << 16 | a, 4, true);
  const std::string head = number_bytes(width, 4, true) + number_bytes(rows.size(), 4, true) +
                           number_bytes(bits, 1, true) + number_bytes(colour_type, 1, true) + std::string(3, '\0');
  return "\x89PNG\r\n\x1a\n" + png_chunk("IHDR", head) + palette + png_chunk("IDAT", stored) + png_chunk("IEND", "");
}

}  // namespace doppel::support
