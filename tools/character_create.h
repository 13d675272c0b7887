#pragma once

#include "command.h"

namespace doppel::tools {

/// Adds `doppel character create`. @param character the parent subcommand
Command add_character_create(CLI::App& character);

}  // namespace doppel::tools
