#pragma once

#include <yaml-cpp/yaml.h>

#include <string>

namespace doppel {

/// The first document of a YAML text from outside. Refused are lists and mappings more than 100 levels deep, aliases
/// that stand inside of what they name, aliases that repeat more than a million nodes in all, and NUL characters: each
/// of them would exhaust the memory, the stack or a message later.
/// @throws YAML::ParserException with the line, also for a text that is not YAML
YAML::Node load_yaml(const std::string& text);

}  // namespace doppel
