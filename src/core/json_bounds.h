#pragma once

#include <cstddef>
#include <string_view>

namespace doppel {

/// Depth and memory of a JSON text, by one pass over the text. Readers of files from outside check them before they
/// parse.

/// Whether lists and objects are nested more than `depth` deep. Programs that walk or print a JSON value call
/// themselves for each level.
bool is_json_deeper_than(std::string_view text, std::size_t depth);

/// A bound of the bytes that the parsed text (nlohmann::json) takes, its strings apart: 32 for each value of a list,
/// with the room in which the list grows, 112 for each key of an object, and 80 for each list or object.
std::size_t json_memory(std::string_view text);

}  // namespace doppel
