#include "docs/words.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::words {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// A made-up tree with the glossary of `rows`.
class Tree {
 public:
  explicit Tree(const std::string& rows) {
    add("docs/glossary.md",
        "# Glossary\n\n| place | elsewhere | no |\n\n## Words that are not used\n\n| word | instead of it | where it "
        "may "
        "stand |\n|---|---|---|\n" +
            rows + "\n## Next\n\n| picture | not a row | |\n");
  }
  void add(const fs::path& file, const std::string& content) {
    fs::create_directories((folder_ / file).parent_path());
    std::ofstream(folder_ / file) << content;
  }
  std::vector<std::string> found() const {
    std::vector<std::string> found;
    for (const Finding& finding : check_words(folder_.path(), read_rules(folder_.path())).findings)
      found.push_back(finding.to_string());
    return found;
  }
  const fs::path& path() const { return folder_.path(); }

 private:
  support::TemporaryFolder folder_;
};

TEST(WordsReference, ThisTreeUsesTheWordsOfTheGlossary) {
  const Report report = check_words(DOPPEL_SOURCE_DIR, read_rules(DOPPEL_SOURCE_DIR));
  EXPECT_GT(report.files, 1000) << "the tree was not found";
  std::string all;
  for (const Finding& finding : report.findings) all += finding.to_string() + "\n";
  EXPECT_TRUE(report.findings.empty()) << all
                                       << "The table is in docs/glossary.md, \"Words that are not used\"; its last "
                                          "column says where a word may stand all the same.";
}

TEST(Words, IdentifiersAreSplit) {
  EXPECT_THAT(words_of("rest_place_ = kMostPlaces + XMLFile2Json;"),
              ElementsAre("rest", "place", "k", "most", "places", "xml", "file", "json"));
  EXPECT_THAT(words_of("replaced \"a\\nplace\" in-place"), ElementsAre("replaced", "a", "place", "in", "place"));
}

TEST(Words, AreFoundInIdentifiersAndProse) {
  Tree tree("| place, places | position | |\n| kMost | `kMax` | |\n");
  tree.add("src/a.h",
           "int emplace;\nint rest_place;\nint SamePlaces();\n// At this PLACE.\nconst int kMostTurns = 3;\nint n = k "
           "* most;\n");
  tree.add("docs/b.md", "Replaces the placement.\nTwo places.\n");
  tree.add("README.md", "A place.\n");
  EXPECT_THAT(
      tree.found(),
      ElementsAre("README.md:1: 'place' is not used: write position",
                  "docs/b.md:2: 'places' is not used: write position", "src/a.h:2: 'place' is not used: write position",
                  "src/a.h:3: 'places' is not used: write position", "src/a.h:4: 'place' is not used: write position",
                  "src/a.h:5: 'kMost' is not used: write `kMax`"));
}

TEST(Words, SeveralWordsCountTogether) {
  Tree tree("| digital double | actor | |\n");
  tree.add("src/a.cpp", "double digital;\nDigitalDouble a;  // a digital\n// double\n");
  EXPECT_THAT(tree.found(), ElementsAre("src/a.cpp:2: 'digital double' is not used: write actor",
                                        "src/a.cpp:2: 'digital double' is not used: write actor"));
}

TEST(Words, MayStandInPhrasesTextsAndPaths) {
  Tree tree("| place | position | `in place`, `place_octaves`, `--place-landmarks`, `src/format/`, `tests/c.cpp` |\n");
  tree.add("src/format/other.h", "int place;\n");
  tree.add("tests/c.cpp", "int place;\n");
  tree.add("tests/d.cpp", "void put_in_place(); // moved in\n// place by place_octaves\nrun(\"--place-landmarks\");\n");
  EXPECT_THAT(tree.found(), IsEmpty());
  tree.add("tests/e.cpp", "int the_place, place_octave;\n");
  EXPECT_THAT(tree.found(), ElementsAre("tests/e.cpp:1: 'place' is not used: write position",
                                        "tests/e.cpp:1: 'place' is not used: write position"));
}

TEST(Words, ReadsNoOtherFiles) {
  Tree tree("| place | position | |\n");
  tree.add("web/dist/page.h", "place");
  tree.add("tests/web/page.py", "place");
  tree.add("build/src/a.h", "place");
  tree.add("docs/image.jpg", "place");
  EXPECT_THAT(tree.found(), IsEmpty());
}

TEST(WordsRejects, GlossariesWithoutATable) {
  const auto message = [](const std::string& rows) -> std::string {
    const Tree tree(rows);
    return support::message_of<std::runtime_error>([&] { read_rules(tree.path()); });
  };
  EXPECT_THAT(message(""), AllOf(HasSubstr("docs/glossary.md"), HasSubstr("Words that are not used")));
  EXPECT_THAT(message("| place | position |\n"), HasSubstr("three columns"));
  EXPECT_THAT(message("| place | position | `in place |\n"), HasSubstr("backtick"));
}

}  // namespace
}  // namespace doppel::words
