#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace doppel {

/// The beginning of a text from a file, for messages: control characters become question marks, because a terminal
/// would obey them, and at most `longest` bytes are shown.
inline std::string excerpt(std::string_view text, std::size_t longest = 60) {
  std::string shown;
  for (const char c : text.substr(0, longest)) shown += static_cast<unsigned char>(c) < 0x20 || c == 0x7f ? '?' : c;
  return text.size() > longest ? shown + "..." : shown;
}

}  // namespace doppel
