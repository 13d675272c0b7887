#pragma once

#include "command.h"

namespace doppel::tools {

/// `doppel character label`. @param character the subcommand it belongs to
Command add_character_label(CLI::App& character);

}  // namespace doppel::tools
