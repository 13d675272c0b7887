#pragma once

#include <filesystem>

#include "command.h"

namespace doppel::tools {

/// The whole program but the set-up of the process: reads the command line, runs one command and prints its errors.
/// @return the exit code: 2 for wrong use, 1 for another failure
int run_program(int argc, const char* const* argv);

/// Runs the command of shards once more, on all of the work, with their results instead of the work.
/// @param out folder for the whole result @param common of the merge @return the exit code of the command
int run_on_shards(const ShardSet& shards, const std::filesystem::path& out, const CommonOptions& common);

}  // namespace doppel::tools
