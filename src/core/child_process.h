#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace doppel {

/// How another program ended, and what it printed.
struct ProgramResult {
  bool found = false;  ///< false: there is no such program in PATH
  int exit_code = 0;   ///< 128 + n when signal n ended the program
  std::string output;  ///< standard output and standard error, the last 4 kB
};

/// Runs a program and waits for its end. No shell is involved, so arguments may hold any characters.
/// @param arguments the program's name and its arguments
/// @param folder the program's working folder; a file for the output is written and removed there
/// @throws Error when the program cannot be started for another reason than that it is missing
ProgramResult run_program(const std::vector<std::string>& arguments, const std::filesystem::path& folder);

}  // namespace doppel
