#include "doppel/core/config.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <type_traits>
#include <utility>

#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/excerpt.h"
#include "doppel/core/load_yaml.h"
#include "doppel/core/text_reader.h"

namespace doppel {

/// Shared state of all readers of one document: its origin, and the keys read from each mapping.
struct ConfigReader::Shared {
  struct Mapping {
    YAML::Node node;
    std::set<std::string> asked;
  };
  std::filesystem::path path;
  std::map<std::string, std::string> overridden;
  std::map<std::string, Mapping> mappings;  // by dotted path
  std::shared_ptr<std::map<std::string, std::string>> values;
};

namespace {

constexpr std::uintmax_t kMaxBytes = 16 << 20;
constexpr std::size_t kMaxShownLength = 200;  // of a text of the file in a message

int line_of(const YAML::Node& node) { return node.IsDefined() && node.Mark().line >= 0 ? node.Mark().line + 1 : 0; }

std::string joined_path(const std::string& prefix, const std::string& key) {
  if (prefix.empty() || key.empty()) return prefix + key;
  return prefix + "." + key;
}

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

template <typename T>
std::string list_text(const std::vector<T>& values) {
  std::vector<std::string> texts;
  texts.reserve(values.size());
  for (const auto& value : values) texts.push_back(fmt::format("{}", value));
  return "[" + joined(texts) + "]";
}

std::string described(const YAML::Node& node) {
  switch (node.Type()) {
    case YAML::NodeType::Scalar:
      return "\"" + excerpt(node.Scalar(), kMaxShownLength) + "\"";
    case YAML::NodeType::Sequence:
      return fmt::format("a list of {}", node.size());
    case YAML::NodeType::Map:
      return "a mapping";
    default:
      return "nothing";
  }
}

std::optional<long> parse_long(const std::string& text) {
  long value = 0;
  const auto [rest, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || rest != text.data() + text.size()) return std::nullopt;
  return value;
}

// One conversion per supported type: the value, or nothing when the scalar is not one.
std::optional<std::string> convert(const YAML::Node& node, const std::string*) { return node.Scalar(); }
std::optional<bool> convert(const YAML::Node& node, const bool*) {
  bool value = false;
  return YAML::convert<bool>::decode(node, value) ? std::optional<bool>(value) : std::nullopt;
}
std::optional<long> convert(const YAML::Node& node, const long*) { return parse_long(node.Scalar()); }
std::optional<int> convert(const YAML::Node& node, const int*) {
  const std::optional<long> value = parse_long(node.Scalar());
  if (!value || *value < std::numeric_limits<int>::min() || *value > std::numeric_limits<int>::max())
    return std::nullopt;
  return static_cast<int>(*value);
}
std::optional<double> convert(const YAML::Node& node, const double*) {
  const std::optional<double> value = parse_number(node.Scalar());
  return value && std::isfinite(*value) ? value : std::nullopt;
}

const char* type_name(const std::string*) { return "a text"; }
const char* type_name(const bool*) { return "true or false"; }
const char* type_name(const int*) { return "an integer"; }
const char* type_name(const long*) { return "an integer"; }
const char* type_name(const double*) { return "a finite number"; }

template <typename T>
std::optional<T> scalar(const YAML::Node& node) {
  if (!node.IsScalar()) return std::nullopt;
  // A quoted scalar has the tag "!" and is therefore text.
  if (!std::is_same_v<T, std::string> && node.Tag() == "!") return std::nullopt;
  return convert(node, static_cast<const T*>(nullptr));
}

template <typename T>
std::string range_text(const Range<T>& range) {
  if (range.minimum && range.maximum) return fmt::format("between {} and {}", *range.minimum, *range.maximum);
  return range.minimum ? fmt::format("at least {}", *range.minimum) : fmt::format("at most {}", *range.maximum);
}

std::vector<std::string> split_dots(const std::string& text) {
  std::vector<std::string> parts{""};
  for (char c : text) {
    if (c == '.') {
      parts.emplace_back();
    } else {
      parts.back() += c;
    }
  }
  return parts;
}

/// The child for one part of an override's key. A mapping without this child gets one.
YAML::Node child_for_override(YAML::Node parent, const std::string& part, const std::string& override_text) {
  if (part.empty())
    fail<UsageError>("--set {}: the key has an empty part; write it as section.key=value", override_text);
  if (parent.IsSequence()) {
    const std::optional<long> index = parse_long(part);
    if (!index || *index < 0 || as_size(*index) >= parent.size()) {
      fail<UsageError>("--set {}: \"{}\" must be an index from 0 to {} into this list", override_text, part,
                       static_cast<long>(parent.size()) - 1);
    }
    return parent[*index];
  }
  if (parent.IsScalar()) {
    fail<UsageError>("--set {}: cannot set \"{}\" inside a plain value (\"{}\")", override_text, part, parent.Scalar());
  }
  return parent[part];
}

/// Whether a text without quotes ends, as YAML, at a number sign.
bool is_cut_off(const YAML::Node& value, const std::string& text) {
  return value.IsScalar() && value.Tag() == "?" && text.find(" #") != std::string::npos;
}

/// Applies `a.b=c`; returns the dotted key.
std::string apply_override(const YAML::Node& root, const std::string& text) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0) {
    fail<UsageError>("--set {}: found no \"key=value\"; write it as section.key=value", text);
  }
  const std::string key = text.substr(0, equals);
  YAML::Node value;
  try {
    value = load_yaml(text.substr(equals + 1));
  } catch (const YAML::Exception& e) {
    fail<UsageError>("--set {}: the value is not YAML: {}", text, e.msg);
  }
  if (is_cut_off(value, text.substr(equals + 1))) value = YAML::Node(text.substr(equals + 1));
  YAML::Node node;
  node.reset(root);
  std::string dotted;
  for (const std::string& part : split_dots(key)) {
    dotted = node.IsSequence() ? dotted + "[" + part + "]" : joined_path(dotted, part);
    node.reset(child_for_override(node, part, text));
  }
  node = value;
  return dotted;
}

/// Edit distance with transpositions of neighbours, which are common typing errors.
std::size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<std::vector<std::size_t>> d(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) d[i][0] = i;
  for (std::size_t j = 0; j <= b.size(); ++j) d[0][j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    for (std::size_t j = 1; j <= b.size(); ++j) {
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + (a[i - 1] != b[j - 1])});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
    }
  }
  return d[a.size()][b.size()];
}

}  // namespace

std::string text_override(const std::string& key, const std::string& text) {
  try {
    const YAML::Node plain = load_yaml(text);
    if (plain.IsScalar() && plain.Scalar() == text) return key + "=" + text;
  } catch (const YAML::Exception&) {  // no YAML without quotes
  }
  YAML::Emitter emitter;
  emitter << YAML::DoubleQuoted << text;
  return key + "=" + emitter.c_str();
}

std::string text_of_override(const std::string& value) {
  try {
    const YAML::Node node = load_yaml(value);
    return node.IsScalar() && node.Tag() == "!" ? node.Scalar() : value;
  } catch (const YAML::Exception&) {
    return value;
  }
}

std::optional<std::string> nearest_word(const std::string& word, const std::vector<std::string>& known) {
  constexpr std::size_t kMaxWordLength = 200;  // a longer word is no typing error
  if (word.size() > kMaxWordLength) return std::nullopt;
  std::optional<std::string> best;
  std::size_t best_distance = std::max<std::size_t>(2, word.size() / 3) + 1;
  for (const std::string& candidate : known) {
    const std::size_t distance = edit_distance(word, candidate);
    if (distance < best_distance && distance < std::max(word.size(), candidate.size())) {
      best_distance = distance;
      best = candidate;
    }
  }
  return best;
}

std::string nearest_word_hint(const std::string& word, const std::vector<std::string>& known) {
  const std::optional<std::string> nearest = nearest_word(word, known);
  return nearest ? "; did you mean " + *nearest + "?" : "";
}

ConfigDocument ConfigDocument::load(const std::filesystem::path& path, const std::vector<std::string>& overrides) {
  return parse(read_file(path, kMaxBytes), path.string(), overrides);
}

ConfigDocument ConfigDocument::parse(const std::string& text, const std::string& name,
                                     const std::vector<std::string>& overrides) {
  ConfigDocument document;
  document.path_ = name;
  try {
    document.node_ = load_yaml(text);
  } catch (const YAML::Exception& e) {
    fail_at({name, e.mark.line >= 0 ? e.mark.line + 1 : 0}, "reading a configuration: this is not YAML: {}",
            excerpt(e.msg, kMaxShownLength));
  }
  if (document.node_.IsNull()) document.node_ = YAML::Node(YAML::NodeType::Map);
  if (!document.node_.IsMap()) {
    fail_at({name, line_of(document.node_)}, "reading a configuration: found {}, expected a mapping of keys to values",
            described(document.node_));
  }
  for (const std::string& text_of_override : overrides) {
    document.overridden_[apply_override(document.node_, text_of_override)] = text_of_override;
  }
  return document;
}

ConfigReader ConfigDocument::root() const {
  auto shared = std::make_shared<ConfigReader::Shared>();
  shared->path = path_;
  shared->overridden = overridden_;
  shared->values = values_;
  shared->mappings[""].node = node_;
  return ConfigReader(shared, node_, "");
}

ConfigDocument ConfigDocument::part(const std::string& section, const std::vector<std::string>& shared) const {
  ConfigDocument document;
  document.path_ = path_;
  document.node_ = YAML::Node(YAML::NodeType::Map);
  for (const std::string& key : shared)
    if (node_[key].IsDefined()) document.node_[key] = node_[key];
  const ConfigReader reader = root().section(section);
  for (const std::string& key : reader.keys()) {
    if (document.node_[key].IsDefined())
      reader.fail_at_key(key, "this key belongs to the top level of the file, for all sections");
    document.node_[key] = node_[section][key];
  }
  for (const auto& [dotted, text] : overridden_) {
    const bool inside = dotted.compare(0, section.size() + 1, section + ".") == 0;
    document.overridden_[inside ? dotted.substr(section.size() + 1) : dotted] = text;
  }
  return document;
}

std::string ConfigDocument::resolved() const {
  YAML::Emitter out;
  // Enough digits to read back the same value.
  out.SetDoublePrecision(17);
  out << node_;
  return std::string(out.c_str()) + "\n";
}

FileLocation ConfigReader::where(const std::string& key) const {
  std::string dotted = joined_path(prefix_, key);
  // The override may have set a mapping that holds this key.
  for (std::string part = dotted; !part.empty();) {
    const auto found = shared_->overridden.find(part);
    if (found != shared_->overridden.end()) return {"--set " + found->second, 0};
    const std::size_t cut = part.find_last_of(".[");
    part = cut == std::string::npos ? "" : part.substr(0, cut);
  }
  const YAML::Node node = key.empty() || !node_.IsMap() ? node_ : node_[key];
  const int line = line_of(node);
  return {shared_->path.string(), line > 0 ? line : line_of(node_)};
}

void ConfigReader::fail_formatted(const std::string& key, const std::string& message) const {
  const std::string dotted = joined_path(prefix_, key);
  throw FileError(where(key), dotted.empty() ? message : excerpt(dotted, kMaxShownLength) + ": " + message);
}

void ConfigReader::note(const std::string& key) const { shared_->mappings[prefix_].asked.insert(key); }

void ConfigReader::note_value(const std::string& key, const std::string& value) const {
  (*shared_->values)[joined_path(prefix_, key)] = value;
}

bool ConfigReader::has(const std::string& key) const {
  note(key);
  return node_.IsMap() && node_[key].IsDefined();
}

template <typename T>
T ConfigReader::get(const std::string& key, const Range<T>& range) const {
  if (!has(key)) fail_at_key(key, "this key is missing; it must be {}", type_name(static_cast<const T*>(nullptr)));
  const YAML::Node node = node_[key];
  const std::optional<T> value = scalar<T>(node);
  if (!value) fail_at_key(key, "found {}, expected {}", described(node), type_name(static_cast<const T*>(nullptr)));
  if ((range.minimum && *value < *range.minimum) || (range.maximum && *value > *range.maximum)) {
    fail_at_key(key, "found {}, allowed is {}", *value, range_text(range));
  }
  note_value(key, fmt::format("{}", *value));
  return *value;
}
template bool ConfigReader::get<bool>(const std::string&, const Range<bool>&) const;
template int ConfigReader::get<int>(const std::string&, const Range<int>&) const;
template long ConfigReader::get<long>(const std::string&, const Range<long>&) const;
template double ConfigReader::get<double>(const std::string&, const Range<double>&) const;
template std::string ConfigReader::get<std::string>(const std::string&, const Range<std::string>&) const;

template <typename T>
std::vector<T> ConfigReader::list(const std::string& key) const {
  std::vector<T> values;
  note_value(key, "[]");
  if (!has(key) || node_[key].IsNull()) return values;
  const YAML::Node node = node_[key];
  const auto take = [&](const YAML::Node& item) {
    const std::optional<T> value = scalar<T>(item);
    if (!value) {
      fail_at_key(key, "found {} in the list, expected {}", described(item), type_name(static_cast<const T*>(nullptr)));
    }
    values.push_back(*value);
  };
  if (node.IsSequence()) {
    for (const YAML::Node& item : node) take(item);
  } else {
    take(node);
  }
  note_value(key, list_text(values));
  return values;
}

template <typename T>
std::vector<T> ConfigReader::list(const std::string& key, const std::vector<T>& fallback) const {
  if (has(key)) return list<T>(key);
  note_value(key, list_text(fallback));
  return fallback;
}
template std::vector<bool> ConfigReader::list<bool>(const std::string&) const;
template std::vector<int> ConfigReader::list<int>(const std::string&) const;
template std::vector<long> ConfigReader::list<long>(const std::string&) const;
template std::vector<double> ConfigReader::list<double>(const std::string&) const;
template std::vector<std::string> ConfigReader::list<std::string>(const std::string&) const;
template std::vector<int> ConfigReader::list<int>(const std::string&, const std::vector<int>&) const;
template std::vector<long> ConfigReader::list<long>(const std::string&, const std::vector<long>&) const;
template std::vector<double> ConfigReader::list<double>(const std::string&, const std::vector<double>&) const;
template std::vector<std::string> ConfigReader::list<std::string>(const std::string&,
                                                                  const std::vector<std::string>&) const;

std::string ConfigReader::choice(const std::string& key, const std::vector<std::string>& allowed,
                                 const std::optional<std::string>& fallback) const {
  if (!has(key)) {
    if (!fallback) fail_at_key(key, "this key is missing; it must be one of {}", joined(allowed));
    note_value(key, *fallback);
    return *fallback;
  }
  const std::string word = get<std::string>(key);
  if (std::find(allowed.begin(), allowed.end(), word) != allowed.end()) return word;
  fail_at_key(key, "found \"{}\", allowed is one of {}{}", excerpt(word, kMaxShownLength), joined(allowed),
              nearest_word_hint(word, allowed));
}

std::filesystem::path ConfigReader::path(const std::string& key, const std::optional<std::string>& fallback) const {
  const std::string written = has(key) || !fallback ? get<std::string>(key) : *fallback;
  if (written.empty()) fail_at_key(key, "found an empty path");
  // A path in an override is relative to the working folder, a path in a file is relative to the folder of the file.
  const bool typed = has(key) && where(key).file.compare(0, 6, "--set ") == 0;
  const std::filesystem::path base = typed ? std::filesystem::path() : shared_->path.parent_path();
  const std::filesystem::path resolved = std::filesystem::absolute(base / written).lexically_normal();
  if (has(key)) {
    YAML::Node node = node_[key];
    node = resolved.string();
  }
  return resolved;
}

ConfigReader ConfigReader::section(const std::string& key) const {
  const bool present = has(key) && !node_[key].IsNull();
  const YAML::Node node = present ? YAML::Node(node_[key]) : YAML::Node(YAML::NodeType::Map);
  if (!node.IsMap()) fail_at_key(key, "found {}, expected a mapping of keys to values", described(node));
  const std::string prefix = joined_path(prefix_, key);
  if (present) shared_->mappings[prefix].node = node;
  return ConfigReader(shared_, node, prefix);
}

std::vector<ConfigReader> ConfigReader::sections(const std::string& key) const {
  std::vector<ConfigReader> readers;
  if (!has(key) || node_[key].IsNull()) return readers;
  const YAML::Node list = node_[key];
  if (!list.IsSequence()) fail_at_key(key, "found {}, expected a list of mappings", described(list));
  for (std::size_t i = 0; i < list.size(); ++i) {
    const std::string prefix = fmt::format("{}[{}]", joined_path(prefix_, key), i);
    const YAML::Node item = list[i];
    if (!item.IsMap()) fail_at_key(key, "item {}: found {}, expected a mapping of keys to values", i, described(item));
    shared_->mappings[prefix].node = item;
    readers.push_back(ConfigReader(shared_, item, prefix));
  }
  return readers;
}

std::vector<std::string> ConfigReader::keys() const {
  std::vector<std::string> names;
  for (const auto& entry : node_) {
    if (!entry.first.IsScalar())
      fail_formatted("", fmt::format("a key must be a word, found {}", described(entry.first)));
    names.push_back(entry.first.Scalar());
    note(names.back());
  }
  return names;
}

void ConfigReader::finish() const {
  for (const auto& [prefix, mapping] : shared_->mappings) {
    const bool inside = prefix_.empty() || prefix == prefix_ ||
                        prefix.compare(0, prefix_.size() + 1, prefix_ + ".") == 0 ||
                        prefix.compare(0, prefix_.size() + 1, prefix_ + "[") == 0;
    if (!inside || !mapping.node.IsMap()) continue;
    const ConfigReader reader(shared_, mapping.node, prefix);
    const std::vector<std::string> known(mapping.asked.begin(), mapping.asked.end());
    std::set<std::string> seen;
    for (const auto& entry : mapping.node) {
      if (!entry.first.IsScalar())
        reader.fail_formatted("", fmt::format("a key must be a word, found {}", described(entry.first)));
      const std::string& key = entry.first.Scalar();
      if (!seen.insert(key).second) {
        throw FileError({shared_->path.string(), line_of(entry.first)},
                        excerpt(joined_path(prefix, key), kMaxShownLength) + ": this key occurs twice");
      }
      if (mapping.asked.count(key)) continue;
      const std::optional<std::string> meant = nearest_word(key, known);
      reader.fail_formatted(key, fmt::format("unknown key; {}", meant           ? "did you mean " + *meant + "?"
                                                                : known.empty() ? std::string("none is expected here")
                                                                                : "known are " + joined(known)));
    }
  }
}

}  // namespace doppel
