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

TEST(LevelsReference, EveryHeaderThatAnotherModuleIncludesIsOffered) {
  EXPECT_EQ(all(check_headers(DOPPEL_SOURCE_DIR)), "");
}

Tree& with_listed_headers(Tree& tree) {
  with_good_files(tree);
  tree.add("src/core/CMakeLists.txt", "doppel_module(core PUBLIC_HEADERS error.h)\n");
  tree.add("src/geometry/CMakeLists.txt", "doppel_module(geometry\n  SHARED_HEADERS mesh.h\n  DEPENDS doppel_core)\n");
  tree.add("src/layers/CMakeLists.txt", "doppel_module(layers PUBLIC_HEADERS\n    skinning/skinning.h\n  DEPENDS x)\n");
  return tree;
}

TEST(LevelsReference, APublicHeaderIncludesPublicHeadersOnly) {
  Tree tree;
  with_listed_headers(tree);
  EXPECT_EQ(all(check_headers(tree.folder())),
            "src/layers/skinning/skinning.h:1: is public and includes a shared header: src/geometry/mesh.h\n");
}

TEST(LevelsRejects, PrivateHeadersOfOtherModules) {
  Tree tree;
  with_listed_headers(tree).add("src/layers/skinning/skinning.h", "");
  tree.add("src/layers/use.cpp", "#include \"doppel/geometry/mesh.h\"\n");
  EXPECT_EQ(all(check_headers(tree.folder())), "");
  tree.add("src/geometry/part.h", "");
  tree.add("src/geometry/mesh.cpp", "#include \"doppel/geometry/part.h\"\n");
  EXPECT_EQ(all(check_headers(tree.folder())), "");
  tree.add("tools/use.cpp", "#include \"doppel/geometry/part.h\"\n");
  EXPECT_THAT(all(check_headers(tree.folder())),
              HasSubstr("tools/use.cpp:1: includes a private header of another module: src/geometry/part.h"));
}

TEST(LevelsRejects, SharedHeadersInExamplesAndWithoutUsers) {
  Tree tree;
  with_listed_headers(tree).add("src/layers/skinning/skinning.h", "");
  tree.add("examples/cpp/use.cpp", "#include <doppel/geometry/mesh.h>\n");
  EXPECT_THAT(all(check_headers(tree.folder())), HasSubstr("examples/cpp/use.cpp:1: includes a shared header"));
  tree.add("examples/cpp/use.cpp", "");
  EXPECT_THAT(all(check_headers(tree.folder())), HasSubstr("src/geometry/mesh.h:0: is shared, but no other module"));
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
  with_good_files(tree).add("src/render/bad.cpp", "#include <doppel/character/skeleton.h>\n");
  tree.add("src/character/skeleton.h", "");
  EXPECT_THAT(all(tree.check()), AllOf(HasSubstr("src/render/bad.cpp:1: "),
                                       HasSubstr("render (level 2) includes sideways character (level 2)")));
}

TEST(LevelsRejects, IncludesWrittenRelatively) {
  Tree tree;
  with_good_files(tree).add("src/core/bad.h", "#include \"../geometry/mesh.h\"\n");
  EXPECT_THAT(all(tree.check()), HasSubstr("core (level 0) includes upwards geometry (level 1)"));
}

TEST(LevelsRejects, IncludesOfTheProgram) {
  Tree tree;
  with_good_files(tree).add("src/render/bad.cpp", "#include \"tools/command.h\"\n");
  EXPECT_THAT(all(tree.check()), HasSubstr("includes upwards tools (level 9)"));
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
