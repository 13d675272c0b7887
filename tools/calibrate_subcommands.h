#pragma once

#include "command.h"

namespace doppel::tools {

/// `doppel calibrate board`, `sync`, `refine` and `world`. @param calibrate the subcommand `doppel calibrate`
Command add_calibrate_board(CLI::App& calibrate);
Command add_calibrate_sync(CLI::App& calibrate);
Command add_calibrate_refine(CLI::App& calibrate);
Command add_calibrate_world(CLI::App& calibrate);

}  // namespace doppel::tools
