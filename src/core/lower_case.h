#pragma once

#include <algorithm>
#include <cctype>
#include <string>

namespace doppel {

/// The text with small letters instead of capitals.
inline std::string lower_case(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

}  // namespace doppel
