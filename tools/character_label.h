#pragma once

#include "command.h"

namespace doppel::tools {

/// Adds `doppel character label`. @param character the parent subcommand
Command add_character_label(CLI::App& character);

}  // namespace doppel::tools
