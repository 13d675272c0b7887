#include "doppel/core/json_bounds.h"

namespace doppel {
namespace {

/// Calls `use` with each character outside of strings, until it returns false.
template <typename Use>
void each_outside_of_strings(std::string_view text, const Use& use) {
  bool in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '"') in_string = !in_string;
    if (in_string && c == '\\') ++i;  // the next character is escaped
    if (!in_string && !use(c)) return;
  }
}

bool opens(char c) { return c == '[' || c == '{'; }
bool closes(char c) { return c == ']' || c == '}'; }

}  // namespace

bool is_json_deeper_than(std::string_view text, std::size_t depth) {
  std::size_t open = 0;
  each_outside_of_strings(text, [&](char c) {
    if (opens(c)) ++open;
    if (closes(c) && open > 0) --open;
    return open <= depth;
  });
  return open > depth;
}

std::size_t json_memory(std::string_view text) {
  constexpr std::size_t kValue = 32, kKey = 112, kContainer = 80;
  std::size_t bytes = kValue;
  each_outside_of_strings(text, [&](char c) {
    if (c == ',') bytes += kValue;
    if (c == ':') bytes += kKey;
    if (opens(c)) bytes += kContainer + kValue;
    return true;
  });
  return bytes;
}

}  // namespace doppel
