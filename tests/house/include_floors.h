#pragma once

#include <filesystem>
#include <string>
#include <vector>

/// The rule of the house: code includes only from floors below its own.
namespace doppel::house {

/// One `#include "doppel/..."` that breaks the rule.
struct Violation {
  std::filesystem::path file;  ///< relative to the tree
  int line = 0;
  std::string message;  ///< names the edge: "core (floor 0) includes geometry (floor 1)"

  std::string to_string() const { return file.string() + ":" + std::to_string(line) + ": " + message; }
};

/// Reads every source and header in `tree`/src/doppel and `tree`/tools.
/// Reports includes that go up, sideways (another room of the same floor), to an unknown room, to a file that is not
/// there, and files that include each other in a circle.
std::vector<Violation> check_includes(const std::filesystem::path& tree);

/// How many files were looked at, so that a test of an empty tree cannot pass for a clean one.
std::size_t count_sources(const std::filesystem::path& tree);

}  // namespace doppel::house
