#pragma once

#include <filesystem>
#include <string>
#include <vector>

/// The tree uses one word for one thing: docs/glossary.md lists words that are not used.
namespace doppel::words {

/// What is not used: a word, several that follow each other, or the beginning of an identifier ("kMost").
struct Unused {
  std::string text;                ///< as the table has it
  std::vector<std::string> words;  ///< in lower case
};

/// A row of the table "Words that are not used".
struct Rule {
  std::vector<Unused> unused;
  std::string instead;
  std::vector<std::vector<std::string>> phrases;  ///< words among which an unused one may stand: "in place"
  std::vector<std::string> texts;                 ///< parts of a line in which it may stand: "--place-landmarks"
  std::vector<std::string> paths;                 ///< files and folders (that end in '/') in which it may stand
};

/// Reads the table below the heading "Words that are not used" of a glossary in Markdown. Its columns are the words,
/// what to write instead, and where the words may stand: phrases, texts and paths in backticks. What has a '/' and
/// names a file or a folder of `tree` is a path; what has letters, '_' and spaces only is a phrase; other things are
/// texts.
/// @throws std::runtime_error for a glossary without the table, or a row without three columns
std::vector<Rule> read_rules(const std::filesystem::path& tree);

/// A word that is not used.
struct Finding {
  std::filesystem::path file;  ///< relative to the tree
  int line = 0;
  std::string word, instead;

  /// "src/a.h:3: 'picture' is not used: write 'image'"
  std::string to_string() const;
};

/// The words of a line in lower case: identifiers are split at '_' and at the borders of CamelCase.
std::vector<std::string> words_of(const std::string& line);

/// What was found, and how many files were read, so that a test of an empty tree cannot pass for a clean one.
struct Report {
  std::vector<Finding> findings;
  int files = 0;
};

/// Reads the text files of the project in `tree`: sources, build files, scripts, configurations and documents. Left out
/// are the glossary itself, the page in web/ with its tests, and the tests of this test.
Report check_words(const std::filesystem::path& tree, const std::vector<Rule>& rules);

}  // namespace doppel::words
