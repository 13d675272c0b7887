#include "levels/include_levels.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "support/temporary_folder.h"

namespace doppel::levels {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

class Tree {
 public:
  void add(const fs::path& file, const std::string& content) {
    fs::create_directories((folder_ / file).parent_path());
    std::ofstream(folder_ / file) << content;
  }
  std::vector<Violation> check() const { return check_includes(folder_.path()); }
  const fs::path& folder() const { return folder_.path(); }

 private:
  support::TemporaryFolder folder_;
};

std::string all(const std::vector<Violation>& violations) {
  std::string text;
  for (const Violation& violation : violations) text += violation.to_string() + "\n";
  return text;
}

Tree& with_good_files(Tree& tree) {
  tree.add("src/core/error.h", "#include <string>\n");
  tree.add("src/geometry/mesh.h", "#include \"doppel/core/error.h\"\n");
  tree.add("src/layers/skinning/skinning.h", "#include \"doppel/geometry/mesh.h\"\n");
  tree.add("src/render/raster.h", "#include \"doppel/core/error.h\"\n");
  tree.add("tools/main.cpp", "#include \"tools/command.h\"\n#include \"doppel/layers/skinning/skinning.h\"\n");
  tree.add("tools/command.h", "#include \"doppel/core/error.h\"\n");
  return tree;
}

TEST(LevelsReference, EveryIncludeOfThisTreeGoesDown) {
  EXPECT_GT(count_sources(DOPPEL_SOURCE_DIR), 20u) << "the tree was not found";
  EXPECT_EQ(all(check_includes(DOPPEL_SOURCE_DIR)), "");
}

TEST(LevelsReference, EveryModuleOfThisTreeIsSmall) { EXPECT_EQ(all(check_sizes(DOPPEL_SOURCE_DIR)), ""); }

TEST(LevelsRejects, ModulesThatGrewTooLarge) {
  Tree tree;
  with_good_files(tree).add("src/core/long.cpp", std::string(7001, '\n'));
  EXPECT_THAT(all(check_sizes(tree.folder())), AllOf(HasSubstr("src/core"), HasSubstr("split the module")));
  EXPECT_THAT(all(check_sizes(tree.folder())), Not(HasSubstr("src/geometry")));
}

TEST(LevelsReference, AGoodTreeIsClean) {
  Tree tree;
  EXPECT_THAT(with_good_files(tree).check(), IsEmpty());
}

TEST(LevelsRejects, IncludesThatGoUp) {
  Tree tree;
  with_good_files(tree).add("src/core/bad.cpp", "// first\n  #  include \"doppel/geometry/mesh.h\"\n");
  EXPECT_THAT(all(tree.check()), AllOf(HasSubstr("src/core/bad.cpp:2: "),
                                       HasSubstr("core (level 0) includes upwards geometry (level 1)")));
}

TEST(LevelsRejects, IncludesThatGoSideways) {
  Tree tree;
  with_good_files(tree).add("src/layers/bad.cpp", "#include <doppel/render/raster.h>\n");
  EXPECT_THAT(all(tree.check()), AllOf(HasSubstr("src/layers/bad.cpp:1: "),
                                       HasSubstr("layers (level 3) includes sideways render (level 3)")));
}

TEST(LevelsRejects, IncludesWrittenRelatively) {
  Tree tree;
  with_good_files(tree).add("src/core/bad.h", "#include \"../geometry/mesh.h\"\n");
  EXPECT_THAT(all(tree.check()), HasSubstr("core (level 0) includes upwards geometry (level 1)"));
}

TEST(LevelsRejects, IncludesOfTheProgram) {
  Tree tree;
  with_good_files(tree).add("src/render/bad.cpp", "#include \"tools/command.h\"\n");
  EXPECT_THAT(all(tree.check()), HasSubstr("includes upwards tools (level 10)"));
}

TEST(LevelsRejects, Circles) {
  Tree tree;
  with_good_files(tree);
  tree.add("src/core/a.h", "#include \"doppel/core/b.h\"\n");
  tree.add("src/core/b.h", "\n#include \"doppel/core/c.h\"\n");
  tree.add("src/core/c.h", "#include \"a.h\"\n");
  const std::vector<Violation> violations = tree.check();
  ASSERT_EQ(violations.size(), 1u) << all(violations);
  EXPECT_THAT(violations[0].message, HasSubstr("src/core/a -> src/core/b -> src/core/c -> src/core/a"));
}

TEST(LevelsRejects, CirclesThroughASource) {
  Tree tree;
  with_good_files(tree);
  tree.add("src/core/a.h", "");
  tree.add("src/core/a.cpp", "#include \"doppel/core/a.h\"\n#include \"doppel/core/b.h\"\n");
  tree.add("src/core/b.h", "#include \"doppel/core/a.h\"\n");
  EXPECT_THAT(all(tree.check()), HasSubstr("src/core/a -> src/core/b -> src/core/a"));
}

TEST(LevelsRejects, ModulesAndFilesThatAreNotThere) {
  Tree tree;
  with_good_files(tree);
  tree.add("src/attic/box.h", "");
  tree.add("src/core/bad.cpp", "#include \"doppel/core/absent.h\"\n#include \"doppel/attic/box.h\"\n");
  EXPECT_THAT(all(tree.check()), AllOf(HasSubstr("src/core/absent.h, which is not there"),
                                       HasSubstr("the module attic, which has no level")));
}

}  // namespace
}  // namespace doppel::levels
