#pragma once

#include <filesystem>
#include <string>
#include <vector>

/// Code includes only from levels below its own module's, and of other modules only the headers that they offer.
namespace doppel::levels {

/// One `#include "doppel/..."` that breaks the rule.
struct Violation {
  std::filesystem::path file;  ///< relative to the tree
  int line = 0;
  std::string message;  ///< names the edge: "core (level 0) includes geometry (level 1)"

  std::string to_string() const { return file.string() + ":" + std::to_string(line) + ": " + message; }
};

/// Reads every source and header in `tree`/src and `tree`/tools.
/// Reports includes that go up, sideways (another module of the same level), to an unknown module, to a file that is
/// not there, and headers with their sources that include each other in a circle.
std::vector<Violation> check_includes(const std::filesystem::path& tree);

/// Reads the lists PUBLIC_HEADERS and SHARED_HEADERS of `tree`/src/<module>/CMakeLists.txt.
/// Reports includes of a header that its module keeps private by another module, includes of a header
/// that is not public by a public header or by `tree`/examples, python and tests/install, and shared headers that no
/// other module includes. The program and shared_library count as modules.
std::vector<Violation> check_headers(const std::filesystem::path& tree);

/// How many files were looked at, so that a test of an empty tree cannot pass for a clean one.
std::size_t count_sources(const std::filesystem::path& tree);

}  // namespace doppel::levels
