#include "docs/words.h"

#include <algorithm>
#include <cctype>
#include <fstream>
#include <map>
#include <set>
#include <sstream>
#include <stdexcept>

namespace doppel::words {
namespace {

namespace fs = std::filesystem;
using Words = std::vector<std::string>;

constexpr const char* kGlossary = "docs/glossary.md";
constexpr const char* kHeading = "## Words that are not used";

/// Rules by the first of their unused words.
using RulesByWord = std::multimap<std::string, std::pair<const Rule*, const Unused*>>;

struct PlacedWord {
  std::string word;
  int line = 0;
};

bool is_letter(char c) { return std::isalpha(static_cast<unsigned char>(c)) != 0; }
bool is_lower(char c) { return std::islower(static_cast<unsigned char>(c)) != 0; }
bool is_upper(char c) { return std::isupper(static_cast<unsigned char>(c)) != 0; }
bool is_digit(char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; }

/// Whether a new word of an identifier begins at `i`: aB, or the last capital of ABc.
bool is_border(const std::string& line, std::size_t i) {
  if (i == 0 || !is_upper(line[i])) return false;
  if (is_lower(line[i - 1]) || is_digit(line[i - 1])) return true;
  return is_upper(line[i - 1]) && i + 1 < line.size() && is_lower(line[i + 1]);
}

std::string trimmed(const std::string& text) {
  const std::size_t begin = text.find_first_not_of(" \t"), end = text.find_last_not_of(" \t");
  return begin == std::string::npos ? "" : text.substr(begin, end - begin + 1);
}

std::vector<std::string> columns_of(const std::string& row) {
  std::vector<std::string> columns;
  std::istringstream stream(row.substr(1));
  for (std::string cell; std::getline(stream, cell, '|');) columns.push_back(trimmed(cell));
  return columns;
}

std::vector<std::string> in_backticks(const std::string& cell) {
  std::vector<std::string> found;
  for (std::size_t begin = cell.find('`'); begin != std::string::npos; begin = cell.find('`', begin)) {
    const std::size_t end = cell.find('`', begin + 1);
    if (end == std::string::npos) throw std::runtime_error("a backtick is not closed in: " + cell);
    found.push_back(cell.substr(begin + 1, end - begin - 1));
    begin = end + 1;
  }
  return found;
}

bool is_phrase(const std::string& text) {
  return std::all_of(text.begin(), text.end(), [](char c) { return is_letter(c) || c == '_' || c == ' '; });
}

Rule rule_of(const std::string& row, const fs::path& tree) {
  const std::vector<std::string> columns = columns_of(row);
  if (columns.size() != 3) throw std::runtime_error(std::string(kGlossary) + ": a row needs three columns: " + row);
  Rule rule;
  std::istringstream unused(columns[0]);
  for (std::string word; std::getline(unused, word, ',');) rule.unused.push_back({trimmed(word), words_of(word)});
  rule.instead = columns[1];
  for (const std::string& allowed : in_backticks(columns[2])) {
    if (allowed.find('/') != std::string::npos && fs::exists(tree / allowed)) {
      rule.paths.push_back(allowed);
    } else if (is_phrase(allowed)) {
      rule.phrases.push_back(words_of(allowed));
    } else {
      rule.texts.push_back(allowed);
    }
  }
  return rule;
}

bool is_text(const fs::path& path) {
  static const std::set<std::string> kExtensions{".h",   ".cpp", ".c",     ".py",     ".md", ".txt", ".yaml",
                                                 ".yml", ".sh",  ".cmake", ".sbatch", ".in", ".toml"};
  return kExtensions.count(path.extension().string()) != 0;
}

std::vector<fs::path> texts(const fs::path& tree) {
  std::vector<fs::path> found;
  const auto add = [&](const fs::path& path) {
    const std::string name = path.lexically_relative(tree).generic_string();
    const bool is_left_out =
        name == kGlossary || name.rfind("tests/web/", 0) == 0 || name.rfind("tests/docs/words", 0) == 0;
    if (is_text(path) && !is_left_out) found.emplace_back(name);
  };
  for (const char* folder : {"benchmarks", "cmake", "configs", "docs", "examples", "include", "python", "scripts",
                             "shared_library", "src", "tests", "tools"}) {
    if (!fs::exists(tree / folder)) continue;
    for (const auto& entry : fs::recursive_directory_iterator(tree / folder))
      if (entry.is_regular_file()) add(entry.path());
  }
  for (const auto& entry : fs::directory_iterator(tree))
    if (entry.is_regular_file()) add(entry.path());
  std::sort(found.begin(), found.end());
  return found;
}

/// Whether `phrase` stands in `text` from `begin` on.
bool stands_at(const std::vector<PlacedWord>& text, std::size_t begin, const Words& phrase) {
  if (begin + phrase.size() > text.size()) return false;
  for (std::size_t i = 0; i < phrase.size(); ++i)
    if (text[begin + i].word != phrase[i]) return false;
  return true;
}

/// Looks for the words of all rules in one file.
class FileCheck {
 public:
  FileCheck(const fs::path& tree, fs::path file, const RulesByWord& rules) : file_(std::move(file)), rules_(rules) {
    std::ifstream stream(tree / file_);
    if (!stream) throw std::runtime_error("cannot read " + file_.string());
    for (std::string line; std::getline(stream, line);) {
      lines_.push_back(line);
      for (std::string& word : words_of(line)) text_.push_back({std::move(word), static_cast<int>(lines_.size())});
    }
  }

  void find(std::vector<Finding>& findings) const {
    for (std::size_t i = 0; i < text_.size(); ++i) {
      const auto [begin, end] = rules_.equal_range(text_[i].word);
      for (auto it = begin; it != end; ++it) {
        const auto& [rule, unused] = it->second;
        if (!stands_at(text_, i, unused->words) || may_stand(*rule, i, unused->words.size())) continue;
        const bool is_in_one_identifier = unused->words.size() > 1 && unused->text.find(' ') == std::string::npos;
        if (is_in_one_identifier && line_of(i).find(unused->text) == std::string::npos) continue;
        findings.push_back({file_, text_[i].line, unused->text, rule->instead});
      }
    }
  }

 private:
  const std::string& line_of(std::size_t word) const { return lines_[static_cast<std::size_t>(text_[word].line) - 1]; }

  bool may_stand(const Rule& rule, std::size_t at, std::size_t count) const {
    const std::string name = file_.generic_string(), &line = line_of(at);
    for (const std::string& path : rule.paths)
      if (name == path || (path.back() == '/' && name.rfind(path, 0) == 0)) return true;
    for (const std::string& text : rule.texts)
      if (line.find(text) != std::string::npos) return true;
    for (const Words& phrase : rule.phrases)
      for (std::size_t before = 0; before + count <= phrase.size() && before <= at; ++before)
        if (stands_at(text_, at - before, phrase)) return true;
    return false;
  }

  fs::path file_;
  const RulesByWord& rules_;
  std::vector<std::string> lines_;
  std::vector<PlacedWord> text_;
};

}  // namespace

std::string Finding::to_string() const {
  return file.generic_string() + ":" + std::to_string(line) + ": '" + word + "' is not used: write " + instead;
}

Words words_of(const std::string& line) {
  Words words;
  std::string word;
  const auto finish = [&] {
    if (!word.empty()) words.push_back(std::move(word));
    word.clear();
  };
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (line[i] == '\\' && i + 1 < line.size() && (line[i + 1] == 'n' || line[i + 1] == 't')) {  // an escape
      finish();
      ++i;
    } else if (!is_letter(line[i])) {
      finish();
    } else {
      if (is_border(line, i)) finish();
      word += static_cast<char>(std::tolower(static_cast<unsigned char>(line[i])));
    }
  }
  finish();
  return words;
}

std::vector<Rule> read_rules(const fs::path& tree) {
  std::ifstream glossary(tree / kGlossary);
  std::string line;
  while (std::getline(glossary, line) && line != kHeading) continue;
  std::vector<Rule> rules;
  int row = 0;
  while (std::getline(glossary, line) && line.rfind("## ", 0) != 0)
    if (!line.empty() && line[0] == '|' && ++row > 2) rules.push_back(rule_of(line, tree));
  if (rules.empty()) throw std::runtime_error(std::string(kGlossary) + " has no table below '" + kHeading + "'");
  return rules;
}

Report check_words(const fs::path& tree, const std::vector<Rule>& rules) {
  RulesByWord by_first_word;
  for (const Rule& rule : rules)
    for (const Unused& unused : rule.unused) by_first_word.emplace(unused.words.at(0), std::make_pair(&rule, &unused));
  Report report;
  for (const fs::path& file : texts(tree)) {
    ++report.files;
    FileCheck(tree, file, by_first_word).find(report.findings);
  }
  return report;
}

}  // namespace doppel::words
