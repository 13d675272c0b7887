#include "doppel/core/options.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <cstdlib>

#include "doppel/core/config.h"

namespace doppel {

namespace {

/// The mapping that holds a key, and the last part of the key.
struct KeyPosition {
  ConfigReader reader;
  std::string key;
};

/// The item `i` of the list `key`, for a part `key[i]`; else the section `part`.
ConfigReader part_of(const ConfigReader& reader, const std::string& part) {
  const std::size_t bracket = part.find('[');
  if (bracket == std::string::npos) return reader.section(part);
  return reader.sections(part.substr(0, bracket))[std::atoi(part.c_str() + bracket + 1)];
}

/// Recursive, because assigning a reader would change the document: a YAML node that is assigned becomes an alias.
KeyPosition position_of(const ConfigReader& reader, const std::string& path) {
  const std::size_t dot = path.find('.');
  if (dot == std::string::npos) return {reader, path};
  return position_of(part_of(reader, path.substr(0, dot)), path.substr(dot + 1));
}

/// A number in the unit of the configuration. Conversion there and back costs the last digit, which is not shown.
double in_file_unit(double option, UnitConversion to_option) {
  if (to_option == same_unit) return option;
  return std::strtod(fmt::format("{:.15g}", option / to_option(1.0)).c_str(), nullptr);
}

/// All digits if they are few.
std::string shown_number(double value) {
  constexpr std::size_t kMaxShownDigits = 10;
  const std::string exact = fmt::format("{:.15g}", value);
  return exact.size() <= kMaxShownDigits ? exact : fmt::format("{:.6g}", value);
}
std::string shown_number(int value) { return fmt::format("{}", value); }
std::string shown_number(std::int64_t value) { return fmt::format("{}", value); }

template <typename T>
std::string shown_range(const Range<T>& range) {
  if (range.minimum && range.maximum)
    return fmt::format("{} to {}", shown_number(*range.minimum), shown_number(*range.maximum));
  if (range.minimum) return fmt::format("{} or more", shown_number(*range.minimum));
  return range.maximum ? fmt::format("{} or less", shown_number(*range.maximum)) : "";
}

template <typename T>
std::string shown_list(const std::vector<T>& list) {
  return fmt::format("`[{}]`", fmt::join(list, ", "));
}

/// Reads options from a configuration.
class OptionReader : public OptionVisitor {
 public:
  explicit OptionReader(const ConfigReader& reader) : reader_(reader) {}

  void visit(const std::string& path, double& option, const Range<double>& range, UnitConversion to_option,
             const std::string&) override {
    const auto [reader, key] = position_of(reader_, path);
    const double written = reader.get(key, in_file_unit(option, to_option), range);
    if (reader.has(key)) option = to_option(written);
  }
  void visit(const std::string& path, int& option, const Range<int>& range, const std::string&) override {
    value(path, option, range);
  }
  void visit(const std::string& path, std::int64_t& option, const Range<std::int64_t>& range,
             const std::string&) override {
    value(path, option, range);
  }
  void visit(const std::string& path, std::optional<double>& option, const Range<double>& range,
             const std::string&) override {
    optional_value(path, option, range);
  }
  void visit(const std::string& path, std::optional<int>& option, const Range<int>& range,
             const std::string&) override {
    optional_value(path, option, range);
  }
  void visit(const std::string& path, bool& option, const std::string&) override { value(path, option, {}); }
  void visit(const std::string& path, std::string& option, const std::string&) override { value(path, option, {}); }
  void visit(const std::string& path, std::filesystem::path& option, const std::string&) override {
    const auto [reader, key] = position_of(reader_, path);
    if (reader.has(key)) option = reader.path(key);
  }
  void visit(const std::string& path, std::vector<std::string>& option, const std::string&) override {
    list(path, option);
  }
  void visit(const std::string& path, std::vector<int>& option, const std::string&) override { list(path, option); }
  void visit(const std::string& path, std::vector<std::int64_t>& option, const std::string&) override {
    list(path, option);
  }
  void visit(const std::string& path, std::vector<double>& option, const std::string&) override { list(path, option); }
  void visit_word(const std::string& path, std::optional<int>& option, const std::vector<std::string>& words,
                  const std::string&) override {
    const auto [reader, key] = position_of(reader_, path);
    if (!option && !reader.has(key)) return;
    const std::string word = reader.choice(key, words, words[option.value_or(0)]);
    option = static_cast<int>(std::find(words.begin(), words.end(), word) - words.begin());
  }
  std::optional<std::size_t> visit_items(const std::string& path, const std::string&) override {
    const auto [reader, key] = position_of(reader_, path);
    return reader.has(key) ? std::optional<std::size_t>(reader.sections(key).size()) : std::nullopt;
  }
  void require(const std::string& path, bool met, const std::string& fault) override {
    if (met) return;
    const auto [reader, key] = position_of(reader_, path);
    reader.fail_at_key(key, "{}", fault);
  }
  void forbid(const std::string& path, const std::string& reason) override {
    const auto [reader, key] = position_of(reader_, path);
    if (reader.has(key)) reader.fail_at_key(key, "{}", reason);
  }

 private:
  template <typename T>
  void value(const std::string& path, T& option, const Range<T>& range) {
    const auto [reader, key] = position_of(reader_, path);
    option = reader.get(key, option, range);
  }
  template <typename T>
  void optional_value(const std::string& path, std::optional<T>& option, const Range<T>& range) {
    const auto [reader, key] = position_of(reader_, path);
    if (option || reader.has(key)) option = reader.get(key, option.value_or(T{}), range);
  }
  template <typename T>
  void list(const std::string& path, std::vector<T>& option) {
    const auto [reader, key] = position_of(reader_, path);
    option = reader.list(key, option);
  }

  const ConfigReader& reader_;
};

/// Makes the rows of a table.
class RowMaker : public OptionVisitor {
 public:
  void visit(const std::string& key, double& option, const Range<double>& range, UnitConversion to_option,
             const std::string& meaning) override {
    add(key, shown_number(in_file_unit(option, to_option)), shown_range(range), meaning);
  }
  void visit(const std::string& key, int& option, const Range<int>& range, const std::string& meaning) override {
    add(key, shown_number(option), shown_range(range), meaning);
  }
  void visit(const std::string& key, std::int64_t& option, const Range<std::int64_t>& range,
             const std::string& meaning) override {
    add(key, shown_number(option), shown_range(range), meaning);
  }
  void visit(const std::string& key, bool& option, const std::string& meaning) override {
    add(key, option ? "true" : "false", "true, false", meaning);
  }
  void visit(const std::string& key, std::optional<double>& option, const Range<double>& range,
             const std::string& meaning) override {
    add(key, option ? shown_number(*option) : "", shown_range(range), meaning);
  }
  void visit(const std::string& key, std::optional<int>& option, const Range<int>& range,
             const std::string& meaning) override {
    add(key, option ? shown_number(*option) : "", shown_range(range), meaning);
  }
  void visit(const std::string& key, std::string& option, const std::string& meaning) override {
    add(key, option, "a text", meaning);
  }
  void visit(const std::string& key, std::filesystem::path& option, const std::string& meaning) override {
    add(key, option.string(), "a path", meaning);
  }
  void visit(const std::string& key, std::vector<std::string>& option, const std::string& meaning) override {
    add(key, shown_list(option), "a list of words", meaning);
  }
  void visit(const std::string& key, std::vector<int>& option, const std::string& meaning) override {
    add(key, shown_list(option), "a list of integers", meaning);
  }
  void visit(const std::string& key, std::vector<std::int64_t>& option, const std::string& meaning) override {
    add(key, shown_list(option), "a list of integers", meaning);
  }
  void visit(const std::string& key, std::vector<double>& option, const std::string& meaning) override {
    add(key, shown_list(option), "a list of numbers", meaning);
  }
  void visit_word(const std::string& key, std::optional<int>& option, const std::vector<std::string>& words,
                  const std::string& meaning) override {
    add(key, option ? words[*option] : "", fmt::format("{}", fmt::join(words, ", ")), meaning);
  }
  /// One item stands for all.
  std::optional<std::size_t> visit_items(const std::string& key, const std::string& meaning) override {
    add(key, "", "a list of mappings", meaning);
    return 1;
  }
  void require(const std::string&, bool, const std::string&) override {}
  void forbid(const std::string&, const std::string&) override {}

  std::vector<KeyRow> rows;

 private:
  void add(const std::string& key, const std::string& value, const std::string& allowed, const std::string& meaning) {
    std::string shown = key;
    for (std::size_t at = shown.find("[0]"); at != std::string::npos; at = shown.find("[0]")) shown.erase(at + 1, 1);
    rows.push_back({shown, value, allowed, meaning});
  }
};

}  // namespace

void visit_with_reader(const ConfigReader& reader, const std::function<void(const Keys&)>& describe) {
  OptionReader visitor(reader);
  describe(Keys(visitor));
}

std::vector<KeyRow> rows_of(const std::function<void(const Keys&)>& describe) {
  RowMaker visitor;
  describe(Keys(visitor));
  return visitor.rows;
}

std::string key_table(const std::vector<KeyRow>& rows) {
  std::string table = "| key | default | allowed | meaning |\n|---|---|---|---|\n";
  const auto cell = [](const std::string& text) { return text.empty() ? " " : " " + text + " "; };
  for (const KeyRow& row : rows)
    table += fmt::format("| `{}` |{}|{}|{}|\n", row.key, cell(row.value), cell(row.allowed), cell(row.meaning));
  return table;
}

}  // namespace doppel
