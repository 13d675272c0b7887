#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace doppel {

/// A whole number of the bytes; 0 beyond their end.
inline std::uint64_t number_at(std::string_view bytes, std::size_t at, std::size_t width, bool big_endian) {
  if (width > bytes.size() || at > bytes.size() - width) return 0;
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < width; ++i)
    value = value << 8 | static_cast<unsigned char>(bytes[at + (big_endian ? i : width - 1 - i)]);
  return value;
}

}  // namespace doppel
