#include "doppel/core/json_depth.h"

namespace doppel {

bool is_json_deeper_than(std::string_view text, std::size_t depth) {
  std::size_t open = 0;
  bool in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '"') in_string = !in_string;
    if (in_string && c == '\\') ++i;  // the next character is escaped
    if (in_string) continue;
    if (c == '[' || c == '{') ++open;
    if ((c == ']' || c == '}') && open > 0) --open;
    if (open > depth) return true;
  }
  return false;
}

}  // namespace doppel
