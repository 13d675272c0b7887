#pragma once

#include "command.h"

namespace doppel::tools {

/// Adds `doppel character fit`. @param character the parent subcommand
Command add_character_fit(CLI::App& character);

}  // namespace doppel::tools
