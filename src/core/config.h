#pragma once

#include <yaml-cpp/yaml.h>

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "doppel/core/error.h"
#include "doppel/core/range.h"

namespace doppel {

/// An override `key=text` for text of any characters: it is quoted where YAML would read something else.
std::string text_override(const std::string& key, const std::string& text);
/// The text that the value of an override stands for: without quotes.
std::string text_of_override(const std::string& value);

/// A YAML document together with overrides from the command line. Read it through `ConfigReader`.
///
/// Usage:
/// @code
///   ConfigDocument document = ConfigDocument::load("egnet.yaml", {"train.batch_size=4"});
///   ConfigReader root = document.root();
///   int batch = root.section("train").get("batch_size", 40, at_least(1));
///   root.finish();   // a key that was not read is an error; the message names the nearest known key
/// @endcode
class ConfigReader;
class ConfigDocument {
 public:
  /// @param overrides `a.b=c` each, applied in order; c is YAML, but a number sign within a text without quotes begins
  /// no comment. A key that the file does not hold is added.
  /// @throws FileError (file:line) for bad YAML; UsageError for an override without `=`.
  static ConfigDocument load(const std::filesystem::path& path, const std::vector<std::string>& overrides = {});
  static ConfigDocument parse(const std::string& text, const std::string& name,
                              const std::vector<std::string>& overrides = {});

  ConfigReader root() const;
  /// A new document whose top level holds the keys of the mapping `section` and the top-level keys `shared` of this
  /// document. Line numbers and overrides in messages stay those of this document.
  /// @throws FileError when `section` exists and is not a mapping, or holds one of the shared keys
  ConfigDocument part(const std::string& section, const std::vector<std::string>& shared) const;
  /// The document with the overrides applied, as YAML text. Paths that were read through `ConfigReader::path` are
  /// absolute, so the text means the same in any folder.
  std::string resolved() const;
  /// Every key that the readers of this document have asked for, by dotted path, with the value that they got as text:
  /// that of the document, or the reader's default. A key that has neither is missing.
  const std::map<std::string, std::string>& values() const { return *values_; }
  const std::filesystem::path& path() const { return path_; }

 private:
  friend class ConfigReader;
  YAML::Node node_;
  std::filesystem::path path_;
  /// The command-line override that set a key, by dotted path, for messages.
  std::map<std::string, std::string> overridden_;
  std::shared_ptr<std::map<std::string, std::string>> values_ = std::make_shared<std::map<std::string, std::string>>();
};

/// One mapping of a configuration, read key by key with types, ranges and defaults. Every error names the file, the
/// line, the dotted key, the value found and the values allowed. Copies share the record of the keys that were read.
class ConfigReader {
 public:
  bool has(const std::string& key) const;

  /// A required value (first form) or a value with a default. Supported T: bool, int, long, double, std::string.
  template <typename T>
  T get(const std::string& key, const Range<T>& range = {}) const;
  template <typename T>
  T get(const std::string& key, const T& fallback, const Range<T>& range = {}) const {
    note(key);
    if (has(key)) return get<T>(key, range);
    note_value(key, fmt::format("{}", fallback));
    return fallback;
  }
  std::string get(const std::string& key, const char* fallback) const {
    return get<std::string>(key, std::string(fallback));
  }

  /// One of a set of words. @throws FileError listing the allowed words and the nearest one
  std::string choice(const std::string& key, const std::vector<std::string>& allowed,
                     const std::optional<std::string>& fallback = std::nullopt) const;
  /// A list of values; a single value counts as a list of one. Empty when the key is missing.
  template <typename T>
  std::vector<T> list(const std::string& key) const;
  /// The same with a default for a missing key.
  template <typename T>
  std::vector<T> list(const std::string& key, const std::vector<T>& fallback) const;
  /// An absolute path; a relative one starts at the folder of the configuration file, or, if it came from an
  /// override, at the working folder.
  std::filesystem::path path(const std::string& key, const std::optional<std::string>& fallback = std::nullopt) const;

  /// Whether the value of a key is a mapping.
  bool has_section(const std::string& key) const { return has(key) && node_[key].IsMap(); }
  /// A nested mapping. A missing mapping reads as empty, so all its keys take their defaults.
  ConfigReader section(const std::string& key) const;
  /// A sequence of mappings; empty when the key is missing.
  std::vector<ConfigReader> sections(const std::string& key) const;
  /// The keys of this mapping in file order, for free-form mappings. Marks all of them as known.
  std::vector<std::string> keys() const;

  /// Throws for the first key in this mapping, or in a section taken from it, that was not read.
  void finish() const;

  /// Throws FileError at `key` (or at this mapping when `key` is empty).
  template <typename... Args>
  [[noreturn]] void fail_at_key(const std::string& key, fmt::format_string<Args...> format, Args&&... args) const {
    fail_formatted(key, fmt::format(format, std::forward<Args>(args)...));
  }
  FileLocation where(const std::string& key = "") const;

 private:
  friend class ConfigDocument;
  struct Shared;
  ConfigReader(std::shared_ptr<Shared> shared, const YAML::Node& node, std::string prefix)
      : shared_(std::move(shared)), node_(node), prefix_(std::move(prefix)) {}
  void note(const std::string& key) const;
  void note_value(const std::string& key, const std::string& value) const;
  [[noreturn]] void fail_formatted(const std::string& key, const std::string& message) const;

  std::shared_ptr<Shared> shared_;
  YAML::Node node_;
  std::string prefix_;
};

/// The element of `known` with the smallest edit distance to `word`, if `word` may be a misspelling of it.
std::optional<std::string> nearest_word(const std::string& word, const std::vector<std::string>& known);
/// "; did you mean X?" with the nearest word, for the end of a message; empty without one.
std::string nearest_word_hint(const std::string& word, const std::vector<std::string>& known);

}  // namespace doppel
