#pragma once

namespace doppel::tools {

/// The whole program but the set-up of the process: reads the command line, runs one command and prints its errors.
/// @return the exit code: 2 for wrong use, 1 for another failure
int run_program(int argc, const char* const* argv);

}  // namespace doppel::tools
