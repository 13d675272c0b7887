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

namespace doppel {

/// A YAML document together with overrides from the command line. Read it through `ConfigReader`.
///
/// Usage:
/// @code
///   ConfigDocument document = ConfigDocument::load("egnet.yaml", {"train.batch_size=4"});
///   ConfigReader root = document.root();
///   int batch = root.section("train").get("batch_size", 40, at_least(1));
///   root.finish();   // any key nobody asked for is an error that names the nearest known one
/// @endcode
class ConfigReader;
class ConfigDocument {
 public:
  /// @param overrides `a.b=c` each, applied in order; c is YAML. A key the file does not hold is added.
  /// @throws FileError (file:line) for bad YAML; UsageError for an override without `=`.
  static ConfigDocument load(const std::filesystem::path& path, const std::vector<std::string>& overrides = {});
  static ConfigDocument parse(const std::string& text, const std::string& name,
                              const std::vector<std::string>& overrides = {});

  ConfigReader root() const;
  /// A document of its own with the keys of the mapping `section` on top, beside the top-level keys `shared` of this
  /// one. Line numbers and overrides in messages stay those of this document.
  /// @throws FileError when `section` is there and no mapping, or holds one of the shared keys
  ConfigDocument part(const std::string& section, const std::vector<std::string>& shared) const;
  /// The document with the overrides in place, as YAML text. Paths that were read through `ConfigReader::path` are
  /// absolute in it, so that it means the same wherever it is kept.
  std::string resolved() const;
  const std::filesystem::path& path() const { return path_; }

 private:
  friend class ConfigReader;
  YAML::Node node_;
  std::filesystem::path path_;
  /// The command-line override a key came from, by its dotted path, for messages.
  std::map<std::string, std::string> overridden_;
};

/// What a number may be: closed interval; the default allows everything finite.
template <typename T>
struct Range {
  std::optional<T> minimum, maximum;
};
template <typename T>
Range<T> at_least(T minimum) {
  return {minimum, std::nullopt};
}
template <typename T>
Range<T> between(T minimum, T maximum) {
  return {minimum, maximum};
}

/// One mapping of a configuration, read key by key with types, ranges and defaults. Every error names file,
/// line, the dotted key, what was found and what is allowed. Copies share the record of the keys asked for.
class ConfigReader {
 public:
  bool has(const std::string& key) const;

  /// A required value (first form) or one with a default. Supported T: bool, int, long, double, std::string.
  template <typename T>
  T get(const std::string& key, const Range<T>& range = {}) const;
  template <typename T>
  T get(const std::string& key, const T& fallback, const Range<T>& range = {}) const {
    note(key);
    return has(key) ? get<T>(key, range) : fallback;
  }
  std::string get(const std::string& key, const char* fallback) const {
    return get<std::string>(key, std::string(fallback));
  }

  /// One of a set of words. @throws FileError listing the words (and the nearest one).
  std::string choice(const std::string& key, const std::vector<std::string>& allowed,
                     const std::optional<std::string>& fallback = std::nullopt) const;
  /// A list of values; a single value counts as a list of one. Empty when the key is missing.
  template <typename T>
  std::vector<T> list(const std::string& key) const;
  /// An absolute path; a relative one starts at the folder of the configuration file, or, if it came from an
  /// override, at the working folder.
  std::filesystem::path path(const std::string& key, const std::optional<std::string>& fallback = std::nullopt) const;

  /// A nested mapping; a missing one reads as empty, so all its keys take their defaults.
  ConfigReader section(const std::string& key) const;
  /// A sequence of mappings; empty when the key is missing.
  std::vector<ConfigReader> sections(const std::string& key) const;
  /// The keys of this mapping in file order (for free-form mappings; marks them all as known).
  std::vector<std::string> keys() const;

  /// Takes a key under the name it had before: moves its value to the new name, with a warning that says so.
  /// @throws FileError when both names are there
  void renamed(const std::string& old_key, const std::string& new_key) const;

  /// Throws for the first key in this mapping (or in a section taken from it) that nobody asked for.
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
  [[noreturn]] void fail_formatted(const std::string& key, const std::string& message) const;

  std::shared_ptr<Shared> shared_;
  YAML::Node node_;
  std::string prefix_;
};

/// The element of `known` with the smallest edit distance to `word`, if it is near enough to be a slip.
std::optional<std::string> nearest_word(const std::string& word, const std::vector<std::string>& known);

}  // namespace doppel
