// The tables of keys in docs are those of the program.
#include "key_tables.h"

#include <gtest/gtest.h>

#include <map>

#include "doppel/core/atomic_file.h"
#include "tools/run_program.h"

namespace doppel::tools {
namespace {

namespace fs = std::filesystem;

/// The text between `<!-- keys: NAME -->` and `<!-- end -->` by name, of all pages.
std::map<std::string, std::string> documented_tables() {
  const std::string begin = "<!-- keys: ", middle = " -->\n\n", end = "\n<!-- end -->";
  std::map<std::string, std::string> tables;
  for (const fs::directory_entry& page : fs::directory_iterator(fs::path(DOPPEL_SOURCE_DIR) / "docs")) {
    if (page.path().extension() != ".md") continue;
    const std::string text = read_file(page.path());
    for (std::size_t at = text.find(begin); at != std::string::npos; at = text.find(begin, at + 1)) {
      const std::size_t name = at + begin.size(), table = text.find(middle, name);
      if (table == std::string::npos) continue;
      tables[text.substr(name, table - name)] =
          text.substr(table + middle.size(), text.find(end, table) - table - middle.size());
    }
  }
  return tables;
}

TEST(KeyTables, OfTheDocsAreThoseOfTheProgram) {
  const std::map<std::string, std::string> tables = documented_tables();
  EXPECT_EQ(tables.size(), key_table_names().size());
  for (const std::string& name : key_table_names()) {
    ASSERT_TRUE(tables.count(name)) << name << " is in no page of docs";
    EXPECT_EQ(tables.at(name), key_table_of(name)) << "run scripts/key_tables.sh";
  }
}

TEST(KeyTables, ArePrintedByInfo) {
  const Outcome found = run("info --keys livecap");
  EXPECT_EQ(found.code, 0);
  EXPECT_NE(found.out.find("| `keypoints.weight` | 460 | 0 to 1e+12 |"), std::string::npos) << found.out;
  const Outcome missing = run("info --keys livecaps");
  EXPECT_EQ(missing.code, 2);
  EXPECT_NE(missing.err.find("did you mean livecap?"), std::string::npos) << missing.err;
  EXPECT_EQ(run("info").code, 2);
}

}  // namespace
}  // namespace doppel::tools
