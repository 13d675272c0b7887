#pragma once

#include <cstdint>
#include <string>

namespace doppel::support {

/// The lowest `width` bytes of a number, as a file holds them.
inline std::string number_bytes(std::uint64_t value, int width, bool big_endian) {
  std::string bytes;
  for (int i = 0; i < width; ++i) bytes += static_cast<char>(value >> 8 * (big_endian ? width - 1 - i : i) & 0xff);
  return bytes;
}

}  // namespace doppel::support
