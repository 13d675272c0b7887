#pragma once

#include "command.h"

namespace doppel::tools {

/// Adds `doppel character import`. @param character the parent subcommand
Command add_character_import(CLI::App& character);

}  // namespace doppel::tools
