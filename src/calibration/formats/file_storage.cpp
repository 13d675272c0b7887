#include "doppel/calibration/formats/file_storage.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <pugixml.hpp>

#include "doppel/calibration/formats/xml_parts.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/excerpt.h"
#include "doppel/core/load_yaml.h"
#include "doppel/core/text_reader.h"

namespace doppel {
namespace {

using Kind = StorageValue::Kind;

constexpr std::uintmax_t kMaxStorageBytes = 64 << 20;
constexpr int kMaxStorageDepth = 100;

StorageValue storage_text(std::string text) {
  StorageValue value;
  value.kind = Kind::text;
  value.text = std::move(text);
  return value;
}

/// A word without quotation marks: a number if it is one.
StorageValue storage_word(const std::string& word) {
  const auto number = parse_number(word);
  const bool is_special = word == ".Nan" || word == ".Inf" || word == "-.Inf";
  if (!number && !is_special) return storage_text(word);
  StorageValue value = storage_text(word);
  value.number = number.value_or(std::numeric_limits<double>::quiet_NaN());
  const bool whole = word.find_first_not_of("+-0123456789") == std::string::npos &&
                     std::abs(value.number) <= std::numeric_limits<int>::max();
  value.kind = whole ? Kind::integer : Kind::real;
  return value;
}

StorageValue storage_of(const YAML::Node& node) {
  StorageValue value;
  if (node.IsScalar()) return node.Tag() == "!" ? storage_text(node.Scalar()) : storage_word(node.Scalar());
  if (node.IsSequence()) {
    value.kind = Kind::list;
    for (const YAML::Node& item : node) value.items.push_back(storage_of(item));
  } else if (node.IsMap()) {
    value.kind = Kind::mapping;
    for (const auto& member : node)
      if (member.first.IsScalar()) value.members.push_back({member.first.Scalar(), storage_of(member.second)});
  }
  return value;
}

/// Words between blanks; a text in quotation marks is one word.
std::vector<StorageValue> storage_words(std::string_view text) {
  std::vector<StorageValue> words;
  for (std::size_t at = 0; (at = text.find_first_not_of(" \t\r\n", at)) != std::string_view::npos;) {
    const bool quoted = text[at] == '"';
    const std::size_t begin = quoted ? at + 1 : at;
    const std::size_t end =
        std::min(quoted ? text.find('"', begin) : text.find_first_of(" \t\r\n", begin), text.size());
    const std::string word(text.substr(begin, end - begin));
    words.push_back(quoted ? storage_text(word) : storage_word(word));
    at = std::min(end + (quoted ? 1 : 0), text.size());
  }
  return words;
}

/// The items of a list are elements with the name `_`.
StorageValue storage_of(const pugi::xml_node& node, int depth, const XmlFile& file) {
  if (depth > kMaxStorageDepth)
    fail_at(file.where(node), "reading a camera calibration: elements are nested more than {} deep", kMaxStorageDepth);
  StorageValue value;
  for (const pugi::xml_node& child : node.children()) {
    if (child.type() != pugi::node_element) continue;
    const bool is_item = std::string_view(child.name()) == "_";
    value.kind = is_item ? Kind::list : Kind::mapping;
    if (is_item)
      value.items.push_back(storage_of(child, depth + 1, file));
    else
      value.members.push_back({child.name(), storage_of(child, depth + 1, file)});
  }
  if (!value.is_none()) return value;
  value.items = storage_words(node.child_value());
  if (value.items.size() == 1) return StorageValue(value.items[0]);
  value.kind = value.items.empty() ? Kind::none : Kind::list;
  return value;
}

StorageValue read_storage_yaml(std::string text, const FileLocation& where) {
  if (text.starts_with("\xEF\xBB\xBF")) text.erase(0, 3);
  text.erase(std::remove(text.begin(), text.end(), '\r'), text.end());
  // OpenCV's directive lacks the blank that YAML wants.
  if (text.starts_with("%YAML:")) text[5] = ' ';
  try {
    return storage_of(load_yaml(text));
  } catch (const YAML::Exception& e) {
    fail_at({where.file, std::max(0, e.mark.line + 1)}, "reading a camera calibration: this file cannot be read: {}",
            excerpt(e.msg, 200));
  }
}

}  // namespace

const StorageValue& StorageValue::operator[](std::string_view key) const {
  static const StorageValue kNone;
  for (const auto& [name, value] : members)
    if (name == key) return value;
  return kNone;
}

std::vector<double> StorageValue::numbers(const std::string& what, const FileLocation& where) const {
  const StorageValue& data = is_mapping() ? (*this)["data"] : *this;
  if (data.kind != Kind::list && !data.is_number())
    fail_at(where, "reading a camera calibration: {} must be a matrix{}", what, is_none() ? ", it is missing" : "");
  std::vector<double> values;
  const auto add = [&](const StorageValue& item) {
    if (!item.is_number() || !std::isfinite(item.number))
      fail_at(where, "reading a camera calibration: {} must hold finite numbers", what);
    values.push_back(item.number);
  };
  if (data.is_number()) add(data);
  for (const StorageValue& item : data.items) add(item);
  const StorageValue &rows = (*this)["rows"], &cols = (*this)["cols"];
  if (!rows.is_none() && rows.number * cols.number != static_cast<double>(values.size()))
    fail_at(where, "reading a camera calibration: {} has {} numbers, expected rows x cols", what, values.size());
  return values;
}

StorageValue read_file_storage(const std::filesystem::path& path) {
  const FileLocation where{path.string(), 0};
  std::string text = read_file(path, kMaxStorageBytes);
  const std::size_t begin = text.find_first_not_of(" \t\r\n\xEF\xBB\xBF");
  StorageValue value;
  if (begin != std::string::npos && text[begin] == '<') {
    const XmlFile file(path);
    value = storage_of(file.root(), 0, file);
  } else {
    if (text.find('\0') != std::string::npos)
      fail_at(where, "reading a camera calibration: this is not a text file (found a NUL byte)");
    value = read_storage_yaml(std::move(text), where);
  }
  if (!value.is_mapping())
    fail_at(where, "reading a camera calibration: the file must hold a mapping from names to values");
  return value;
}

}  // namespace doppel
