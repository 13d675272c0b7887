#pragma once

#include <algorithm>
#include <initializer_list>
#include <string>

namespace doppel {

/// Whether the name of a bone or a landmark holds one of the words.
inline bool holds_any(const std::string& name, std::initializer_list<const char*> words) {
  return std::any_of(words.begin(), words.end(),
                     [&](const char* word) { return name.find(word) != std::string::npos; });
}

}  // namespace doppel
