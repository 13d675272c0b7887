#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "doppel/core/range.h"

namespace doppel {

/// The keys of a configuration, each written once. For a struct `T` of options, a function
/// @code
///   void describe_keys(const Keys& keys, T& options) {
///     keys("keypoints.weight", options.keypoint_weight, at_least(0.0), "weight per squared pixel");
///     keys("units", options.units, {"pixels", "fractions"}, "unit of the points");  // an enumeration, in its order
///     describe_keys(keys.section("solver"), options.solver);
///   }
/// @endcode
/// lists key, member, allowed values and meaning. The default is that of the member. `read_keys` reads a configuration
/// through this list, and `key_rows` makes the table of the documentation from the same list.

class ConfigReader;

/// From the unit of a configuration to that of the option: a multiplication.
using UnitConversion = double (*)(double);
inline double same_unit(double value) { return value; }

/// What is done with the options of a list, one after the other. Keys are dotted paths; an item of a list is `key[i]`.
class OptionVisitor {
 public:
  virtual ~OptionVisitor() = default;
  virtual void visit(const std::string& key, double& option, const Range<double>& range, UnitConversion to_option,
                     const std::string& meaning) = 0;
  virtual void visit(const std::string& key, int& option, const Range<int>& range, const std::string& meaning) = 0;
  virtual void visit(const std::string& key, std::int64_t& option, const Range<std::int64_t>& range,
                     const std::string& meaning) = 0;
  virtual void visit(const std::string& key, bool& option, const std::string& meaning) = 0;
  virtual void visit(const std::string& key, std::string& option, const std::string& meaning) = 0;
  virtual void visit(const std::string& key, std::filesystem::path& option, const std::string& meaning) = 0;
  virtual void visit(const std::string& key, std::vector<std::string>& option, const std::string& meaning) = 0;
  virtual void visit(const std::string& key, std::vector<int>& option, const std::string& meaning) = 0;
  virtual void visit(const std::string& key, std::vector<std::int64_t>& option, const std::string& meaning) = 0;
  virtual void visit(const std::string& key, std::vector<double>& option, const std::string& meaning) = 0;
  /// Nothing: the key has no default.
  virtual void visit(const std::string& key, std::optional<double>& option, const Range<double>& range,
                     const std::string& meaning) = 0;
  virtual void visit(const std::string& key, std::optional<int>& option, const Range<int>& range,
                     const std::string& meaning) = 0;
  /// @param option index of the word; nothing: the key has no default
  virtual void visit_word(const std::string& key, std::optional<int>& option, const std::vector<std::string>& words,
                          const std::string& meaning) = 0;
  /// A list of mappings. @return the number of items to visit; nothing: the list stays as it is
  virtual std::optional<std::size_t> visit_items(const std::string& key, const std::string& meaning) = 0;
  /// A condition on a value that a range cannot express. @param fault says what is allowed
  virtual void require(const std::string& key, bool met, const std::string& fault) = 0;
  /// A key that may not be set here. @param reason what gives the value instead
  virtual void forbid(const std::string& key, const std::string& reason) = 0;
};

/// One mapping of a configuration, to list its keys.
class Keys {
 public:
  explicit Keys(OptionVisitor& visitor, std::string prefix = "") : visitor_(&visitor), prefix_(std::move(prefix)) {}

  /// The keys of a nested mapping.
  Keys section(const std::string& key) const { return Keys(*visitor_, path(key)); }

  void operator()(const char* key, double& option, const Range<double>& range, const std::string& meaning,
                  UnitConversion to_option = same_unit) const {
    visitor_->visit(path(key), option, range, to_option, meaning);
  }
  void operator()(const char* key, int& option, const Range<int>& range, const std::string& meaning) const {
    visitor_->visit(path(key), option, range, meaning);
  }
  void operator()(const char* key, std::int64_t& option, const Range<std::int64_t>& range,
                  const std::string& meaning) const {
    visitor_->visit(path(key), option, range, meaning);
  }
  /// A number without a default.
  template <typename T>
  void operator()(const char* key, std::optional<T>& option, const Range<T>& range, const std::string& meaning) const {
    visitor_->visit(path(key), option, range, meaning);
  }
  /// A flag, a text, a path, or a list of words or numbers.
  template <typename T>
  void operator()(const char* key, T& option, const std::string& meaning) const {
    visitor_->visit(path(key), option, meaning);
  }
  /// An enumeration, or a flag with a word for false and one for true. @param words in the order of the values
  template <typename T>
  void operator()(const char* key, T& option, const std::vector<std::string>& words, const std::string& meaning) const {
    static_assert(std::is_enum_v<T> || std::is_same_v<T, bool>);
    std::optional<int> index = static_cast<int>(option);
    visitor_->visit_word(path(key), index, words, meaning);
    option = static_cast<T>(*index);
  }
  /// An enumeration without a default.
  template <typename T>
  void operator()(const char* key, std::optional<T>& option, const std::vector<std::string>& words,
                  const std::string& meaning) const {
    static_assert(std::is_enum_v<T>);
    std::optional<int> index;
    if (option) index = static_cast<int>(*option);
    visitor_->visit_word(path(key), index, words, meaning);
    if (index) option = static_cast<T>(*index);
  }
  /// A list of mappings with the keys of T. Items of a configuration start with the defaults of T.
  template <typename T>
  void items(const char* key, std::vector<T>& list, const std::string& meaning) const {
    const std::optional<std::size_t> count = visitor_->visit_items(path(key), meaning);
    if (!count) return;
    list.assign(*count, T{});
    for (std::size_t i = 0; i < list.size(); ++i) describe_keys(section(fmt::format("{}[{}]", key, i)), list[i]);
  }

  void require(const char* key, bool met, const std::string& fault) const { visitor_->require(path(key), met, fault); }
  void forbid(const char* key, const std::string& reason) const { visitor_->forbid(path(key), reason); }

 private:
  std::string path(const std::string& key) const { return prefix_.empty() ? key : prefix_ + "." + key; }

  OptionVisitor* visitor_;
  std::string prefix_;
};

/// Visits keys with a reader of `reader`. @throws FileError at a key whose value is not allowed
void visit_with_reader(const ConfigReader& reader, const std::function<void(const Keys&)>& describe);

/// Reads all options. An option whose key is missing keeps its value.
/// @throws FileError at a key whose value is not allowed
template <typename T>
void read_keys(const ConfigReader& reader, T& options) {
  visit_with_reader(reader, [&](const Keys& keys) { describe_keys(keys, options); });
}

/// The options of a configuration. @param options the values of missing keys
template <typename T>
T read_options(const ConfigReader& reader, T options = {}) {
  read_keys(reader, options);
  return options;
}

/// A key as the documentation shows it. The items of a list of mappings have one row per key, `key[].x`.
struct KeyRow {
  std::string key, value, allowed, meaning;
};

/// The rows of the keys that `describe` lists, in their order.
std::vector<KeyRow> rows_of(const std::function<void(const Keys&)>& describe);

/// The keys of T with its defaults.
template <typename T>
std::vector<KeyRow> key_rows(T options = {}) {
  return rows_of([&](const Keys& keys) { describe_keys(keys, options); });
}

/// A table in Markdown.
std::string key_table(const std::vector<KeyRow>& rows);

}  // namespace doppel
