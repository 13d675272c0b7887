// `doppel info --versions`: what a report of an error names.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <regex>
#include <string>

#include "doppel/core/atomic_file.h"
#include "doppel/core/cpu_dispatch.h"
#include "run_program.h"

namespace doppel::versions_test {
namespace {

using tools::Outcome;
using tools::run;

/// The first match of the group of `pattern` in a file of the tree.
std::string written_in(const std::string& file, const std::string& pattern) {
  const std::string text = read_file(std::filesystem::path(DOPPEL_SOURCE_DIR) / file);
  std::smatch match;
  return std::regex_search(text, match, std::regex(pattern)) ? match[1].str() : "none in " + file;
}

TEST(Version, IsTheSameWhereverItIsWritten) {
  std::string version = run("--version").out;
  version.pop_back();
  EXPECT_EQ(written_in("CHANGELOG.md", "\n## ([0-9.]+) - "), version);
  EXPECT_EQ(written_in("CITATION.cff", "\nversion: (\\S+)"), version);
  EXPECT_EQ(written_in("python/pyproject.toml", "\nversion = \"(.*)\""), version);
  EXPECT_EQ(written_in("docs/platforms.md", "/doppel_(.*)_amd64.deb"), version);
  EXPECT_EQ(written_in("CITATION.cff", "\ndate-released: (\\S+)"), written_in("CHANGELOG.md", "\n## [0-9.]+ - (\\S+)"));
}

TEST(InfoVersions, NamesProgramLibrariesAndProcessor) {
  const Outcome described = run("info --versions --json --threads 2");
  ASSERT_EQ(described.code, 0) << described.err;
  const nlohmann::json found = nlohmann::json::parse(described.out);
  EXPECT_EQ(found["doppel"].get<std::string>() + "\n", run("--version").out);
  for (const char* library : {"libtorch", "opencv", "eigen", "yaml_cpp", "spdlog"})
    EXPECT_THAT(found[library].get<std::string>(), ::testing::MatchesRegex("[0-9]+\\.[0-9]+\\.[0-9]+.*")) << library;
  EXPECT_NE(found["blas"], "");
  EXPECT_THAT(found["compiler"].get<std::string>(), ::testing::MatchesRegex("(GCC|Clang) [0-9]+\\..*"));
  EXPECT_EQ(found["instruction_set"], isa_name(cpu_isa()));
  EXPECT_EQ(found["threads"], 2);
  EXPECT_NE(run("info --versions").out.find("instruction_set: " + std::string(isa_name(cpu_isa())) + "\n"),
            std::string::npos);
}

TEST(InfoRejects, NeitherPathNorVersionsAndBoth) {
  const Outcome neither = run("info"), both = run("info actor.character --versions");
  EXPECT_EQ(neither.code, 2);
  EXPECT_NE(neither.err.find("name a file or a folder, or ask for --versions"), std::string::npos) << neither.err;
  EXPECT_EQ(both.code, 2);
}

}  // namespace
}  // namespace doppel::versions_test
