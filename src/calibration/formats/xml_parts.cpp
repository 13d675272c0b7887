#include "doppel/calibration/formats/xml_parts.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>

#include "doppel/calibration/formats/camera_parts.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/excerpt.h"
#include "doppel/core/text_reader.h"

namespace doppel {
namespace {

constexpr std::uintmax_t kXmlMaxBytes = 64 << 20;
constexpr std::string_view kXmlBlanks = " \t\r\n";

/// How the characters of a file are stored.
enum class XmlEncoding { utf8, utf16_little, utf16_big };

XmlEncoding xml_encoding(std::string_view bytes) {
  if (bytes.size() < 2) return XmlEncoding::utf8;
  const auto first = static_cast<unsigned char>(bytes[0]), second = static_cast<unsigned char>(bytes[1]);
  if ((first == 0xFF && second == 0xFE) || (first == '<' && second == 0)) return XmlEncoding::utf16_little;
  if ((first == 0xFE && second == 0xFF) || (first == 0 && second == '<')) return XmlEncoding::utf16_big;
  return XmlEncoding::utf8;
}

void xml_append_utf8(std::uint32_t code, std::string& to) {
  if (code < 0x80) {
    to += static_cast<char>(code);
  } else if (code < 0x800) {
    to += static_cast<char>(0xC0 | (code >> 6));
    to += static_cast<char>(0x80 | (code & 0x3F));
  } else {
    to += static_cast<char>(0xE0 | (code >> 12));
    to += static_cast<char>(0x80 | ((code >> 6) & 0x3F));
    to += static_cast<char>(0x80 | (code & 0x3F));
  }
}

/// Characters beyond 16 bits become question marks: they occur at most in names.
std::string xml_utf8_from_utf16(std::string_view bytes, XmlEncoding encoding) {
  const std::size_t low = encoding == XmlEncoding::utf16_little ? 0 : 1;
  std::string text;
  text.reserve(bytes.size() / 2);
  for (std::size_t i = 0; i + 1 < bytes.size(); i += 2) {
    const auto code = static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[i + low])) |
                      static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[i + 1 - low])) << 8;
    if (code == 0xFEFF) continue;  // byte order mark
    xml_append_utf8(code >= 0xD800 && code < 0xE000 ? std::uint32_t{'?'} : code, text);
  }
  return text;
}

std::string_view xml_trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(kXmlBlanks);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kXmlBlanks) - begin + 1);
}

/// The value of a key, or nothing.
std::optional<std::string_view> xml_value(const pugi::xml_node& node, const char* key) {
  if (const pugi::xml_attribute attribute = node.attribute(key)) return xml_trimmed(attribute.value());
  if (const pugi::xml_node child = node.child(key)) return xml_trimmed(child.child_value());
  return std::nullopt;
}

}  // namespace

XmlFile::XmlFile(const std::filesystem::path& path) : path_(path), text_(read_file(path, kXmlMaxBytes)) {
  if (const XmlEncoding encoding = xml_encoding(text_); encoding != XmlEncoding::utf8)
    text_ = xml_utf8_from_utf16(text_, encoding);
  if (text_.rfind("\xEF\xBB\xBF", 0) == 0) text_.erase(0, 3);
  if (text_.find('\0') != std::string::npos)
    fail_at({path_.string(), 0}, "reading a camera calibration: this is not a text file (found a NUL byte)");
  const pugi::xml_parse_result result =
      document_.load_buffer(text_.data(), text_.size(), pugi::parse_default, pugi::encoding_utf8);
  if (!result) {
    const auto end = text_.begin() + std::clamp<std::ptrdiff_t>(result.offset, 0, std::ssize(text_));
    fail_at({path_.string(), static_cast<int>(1 + std::count(text_.begin(), end, '\n'))},
            "reading a camera calibration: this is no valid XML ({}); is the file truncated?", result.description());
  }
  const auto elements = document_.children();
  const auto count = std::count_if(elements.begin(), elements.end(),
                                   [](const pugi::xml_node& node) { return node.type() == pugi::node_element; });
  if (count != 1)
    fail_at({path_.string(), 0}, "reading a camera calibration: this XML has {} root elements, expected 1", count);
}

FileLocation XmlFile::where(const pugi::xml_node& node) const {
  const std::ptrdiff_t offset = node.offset_debug();
  if (offset < 0 || offset > std::ssize(text_)) return {path_.string(), 0};
  return {path_.string(), static_cast<int>(1 + std::count(text_.begin(), text_.begin() + offset, '\n'))};
}

XmlPart::XmlPart(const XmlFile& file, const pugi::xml_node& node, std::string what)
    : file_(&file), node_(node), what_(std::move(what)) {}

bool XmlPart::has(const char* key) const { return xml_value(node_, key).has_value(); }

std::string XmlPart::text(const char* key) const {
  const auto value = xml_value(node_, key);
  if (!value) fail_here("{} is missing in <{}>", key, node_.name());
  return std::string(*value);
}

std::string XmlPart::text_or(const char* key, const std::string& otherwise) const {
  return has(key) ? text(key) : otherwise;
}

double XmlPart::number(const char* key) const { return numbers(key, 1)[0]; }

double XmlPart::number_or(const char* key, double otherwise) const { return has(key) ? number(key) : otherwise; }

std::vector<double> XmlPart::numbers(const char* key, std::size_t count) const {
  return numbers_of(key, text(key), count);
}

std::vector<double> XmlPart::numbers_after_word(const char* key, std::size_t count) const {
  const std::string value = text(key);
  const std::size_t end = std::min(value.find_first_of(kXmlBlanks), value.size());
  const bool has_word = !parse_number(std::string_view(value).substr(0, end));
  return numbers_of(key, std::string_view(value).substr(has_word ? end : 0), count);
}

std::vector<double> XmlPart::numbers_of(const char* key, std::string_view value, std::size_t count) const {
  std::vector<double> found;
  for (std::size_t begin = 0; (begin = value.find_first_not_of(kXmlBlanks, begin)) != std::string_view::npos;) {
    const std::size_t end = std::min(value.find_first_of(kXmlBlanks, begin), value.size());
    const auto number = parse_number(value.substr(begin, end - begin));
    if (!number || !std::isfinite(*number)) fail_here("{} is \"{}\", expected finite numbers", key, excerpt(value));
    found.push_back(*number);
    begin = end;
  }
  if (count != 0 && found.size() != count)
    fail_here("{} is \"{}\", expected {} number{}", key, excerpt(value), count, count == 1 ? "" : "s");
  return found;
}

int XmlPart::pixels(const char* key) const {
  return image_side(number(key), fmt::format("{}: {}", what_, key), where());
}

XmlPart XmlPart::child(const char* name) const {
  const pugi::xml_node child = node_.child(name);
  if (!child) fail_here("<{}> has no element <{}>", node_.name(), name);
  return {*file_, child, what_};
}

std::string readable_head(const CalibrationSource& source) {
  const XmlEncoding encoding = xml_encoding(source.head);
  return encoding == XmlEncoding::utf8 ? source.head : xml_utf8_from_utf16(source.head, encoding);
}

std::string_view root_element(std::string_view head) {
  if (head.substr(0, 3) == "\xEF\xBB\xBF") head.remove_prefix(3);
  while (true) {
    const std::size_t begin = head.find_first_not_of(kXmlBlanks);
    if (begin == std::string_view::npos || head[begin] != '<') return {};
    head.remove_prefix(begin);
    const bool comment = head.substr(0, 4) == "<!--";
    if (!comment && head.substr(0, 2) != "<?" && head.substr(0, 2) != "<!") break;
    const std::string_view closing = comment ? "-->" : ">";
    const std::size_t end = head.find(closing);
    if (end == std::string_view::npos) return {};
    head.remove_prefix(end + closing.size());
  }
  return head.substr(1, std::min(head.find_first_of(" \t\r\n/>", 1), head.size()) - 1);
}

}  // namespace doppel
