#include "house/include_floors.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "support/temporary_folder.h"

namespace doppel::house {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class Tree {
 public:
  void add(const fs::path& file, const std::string& content) {
    fs::create_directories((folder_ / file).parent_path());
    std::ofstream(folder_ / file) << content;
  }
  std::vector<Violation> check() const { return check_includes(folder_.path()); }

 private:
  support::TemporaryFolder folder_;
};

std::string all(const std::vector<Violation>& violations) {
  std::string text;
  for (const Violation& violation : violations) text += violation.to_string() + "\n";
  return text;
}

Tree& with_good_files(Tree& tree) {
  tree.add("src/doppel/core/error.h", "#include <string>\n");
  tree.add("src/doppel/geometry/mesh.h", "#include \"doppel/core/error.h\"\n");
  tree.add("src/doppel/layers/skinning/skinning.h", "#include \"doppel/geometry/mesh.h\"\n");
  tree.add("src/doppel/render/raster.h", "#include \"doppel/core/error.h\"\n");
  tree.add("tools/main.cpp", "#include \"tools/command.h\"\n#include \"doppel/layers/skinning/skinning.h\"\n");
  tree.add("tools/command.h", "#include \"doppel/core/error.h\"\n");
  return tree;
}

TEST(HouseReference, EveryIncludeOfThisTreeGoesDown) {
  EXPECT_GT(count_sources(DOPPEL_SOURCE_DIR), 20u) << "the tree was not found";
  EXPECT_EQ(all(check_includes(DOPPEL_SOURCE_DIR)), "");
}

TEST(HouseReference, AGoodTreeIsClean) {
  Tree tree;
  EXPECT_THAT(with_good_files(tree).check(), IsEmpty());
}

TEST(HouseRejects, IncludesThatGoUp) {
  Tree tree;
  with_good_files(tree).add("src/doppel/core/bad.cpp", "// first\n  #  include \"doppel/geometry/mesh.h\"\n");
  EXPECT_THAT(all(tree.check()), AllOf(HasSubstr("src/doppel/core/bad.cpp:2: "),
                                       HasSubstr("core (floor 0) includes upwards geometry (floor 1)")));
}

TEST(HouseRejects, IncludesThatGoSideways) {
  Tree tree;
  with_good_files(tree).add("src/doppel/layers/bad.cpp", "#include <doppel/render/raster.h>\n");
  EXPECT_THAT(all(tree.check()), AllOf(HasSubstr("src/doppel/layers/bad.cpp:1: "),
                                       HasSubstr("layers (floor 3) includes sideways render (floor 3)")));
}

TEST(HouseRejects, IncludesWrittenRelatively) {
  Tree tree;
  with_good_files(tree).add("src/doppel/core/bad.h", "#include \"../geometry/mesh.h\"\n");
  EXPECT_THAT(all(tree.check()), HasSubstr("core (floor 0) includes upwards geometry (floor 1)"));
}

TEST(HouseRejects, IncludesOfTheProgram) {
  Tree tree;
  with_good_files(tree).add("src/doppel/render/bad.cpp", "#include \"tools/command.h\"\n");
  EXPECT_THAT(all(tree.check()), HasSubstr("includes upwards tools (floor 7)"));
}

TEST(HouseRejects, Circles) {
  Tree tree;
  with_good_files(tree);
  tree.add("src/doppel/core/a.h", "#include \"doppel/core/b.h\"\n");
  tree.add("src/doppel/core/b.h", "\n#include \"doppel/core/c.h\"\n");
  tree.add("src/doppel/core/c.h", "#include \"a.h\"\n");
  const std::vector<Violation> violations = tree.check();
  ASSERT_EQ(violations.size(), 1u) << all(violations);
  EXPECT_THAT(violations[0].message, HasSubstr("src/doppel/core/a.h -> src/doppel/core/b.h -> src/doppel/core/c.h -> "
                                               "src/doppel/core/a.h"));
}

TEST(HouseRejects, RoomsAndFilesThatAreNotThere) {
  Tree tree;
  with_good_files(tree);
  tree.add("src/doppel/attic/box.h", "");
  tree.add("src/doppel/core/bad.cpp", "#include \"doppel/core/absent.h\"\n#include \"doppel/attic/box.h\"\n");
  EXPECT_THAT(all(tree.check()), AllOf(HasSubstr("src/doppel/core/absent.h, which is not there"),
                                       HasSubstr("the room attic, which has no floor")));
}

}  // namespace
}  // namespace doppel::house
