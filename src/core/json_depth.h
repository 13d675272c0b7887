#pragma once

#include <cstddef>
#include <string_view>

namespace doppel {

/// Whether lists and objects of a JSON text are nested more than `depth` deep. Programs that walk or print a JSON value
/// call themselves for each level, so readers of files from outside ask this first.
bool is_json_deeper_than(std::string_view text, std::size_t depth);

}  // namespace doppel
