#pragma once

#include <nlohmann/json.hpp>

#include "doppel/character/character.h"

namespace doppel::tools {

/// A report about a character, in the order of printing: counts, units, options, checks.
/// @param verbose adds every DoF with its limits and joints, and the joint of every bone
nlohmann::ordered_json describe_character(const Character& character, bool verbose);

/// Prints a report to stdout: as one JSON object, or as indented `key: value` lines.
void print_report(const nlohmann::ordered_json& report, bool json);

}  // namespace doppel::tools
