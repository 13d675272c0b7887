#include "doppel/io/scene/ply_file.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <sstream>

#include "doppel/core/atomic_file.h"
#include "doppel/core/text_reader.h"

namespace doppel {

namespace {

using Type = PlyProperty::Type;

constexpr std::size_t kMaxHeaderBytes = 1 << 20;

struct PlyTypeName {
  const char *name, *other;
  Type type;
};
constexpr std::array<PlyTypeName, 8> kPlyTypes{{{"char", "int8", Type::int8},
                                                {"uchar", "uint8", Type::uint8},
                                                {"short", "int16", Type::int16},
                                                {"ushort", "uint16", Type::uint16},
                                                {"int", "int32", Type::int32},
                                                {"uint", "uint32", Type::uint32},
                                                {"float", "float32", Type::float32},
                                                {"double", "float64", Type::float64}}};

template <typename T>
double ply_value(const char* bytes, bool swapped) {
  std::array<char, sizeof(T)> own;
  std::memcpy(own.data(), bytes, sizeof(T));
  if (swapped) std::reverse(own.begin(), own.end());
  return static_cast<double>(std::bit_cast<T>(own));
}

/// Bytes that a row takes at least: of a list its length alone; of a text a character and a blank each.
std::size_t smallest_row(const PlyElement& element, bool text) {
  std::size_t bytes = 0;
  for (const PlyProperty& property : element.properties)
    bytes += text ? 2 : ply_size(property.is_list ? property.count_type : property.type);
  return bytes;
}

}  // namespace

std::size_t ply_size(Type type) {
  constexpr std::array<std::size_t, 8> kSizes{1, 1, 2, 2, 4, 4, 4, 8};
  return kSizes[static_cast<std::size_t>(type)];
}

bool ply_is_float(Type type) { return type == Type::float32 || type == Type::float64; }

PlyFile::PlyFile(const std::filesystem::path& path) : path_(path), bytes_(read_file(path)) {
  read_header();
  check_counts();
}

void PlyFile::read_header() {
  if (bytes_.compare(0, 3, "ply") != 0) fail_here("is no PLY file: it does not begin with 'ply'");
  bool ended = false;
  while (!ended && at_ < std::min(bytes_.size(), kMaxHeaderBytes)) {
    const std::size_t end = std::min(bytes_.find_first_of("\r\n", at_), bytes_.size());
    const std::string line = bytes_.substr(at_, std::min<std::size_t>(end - at_, 4096));
    at_ = std::min(end + 1, bytes_.size());
    if (bytes_.compare(end, 2, "\r\n") == 0) ++at_;
    std::istringstream stream(line);
    std::vector<std::string> words;
    for (std::string word; stream >> word;) words.push_back(word);
    ended = !words.empty() && words[0] == "end_header";
    if (!ended && !words.empty()) read_header_line(words, line);
  }
  if (!ended) fail_here("the file is truncated or no PLY file: its header has no 'end_header'");
  if (!format_known_)
    fail_here("the header does not say the format of the numbers; it needs a line 'format ascii 1.0'");
}

void PlyFile::read_header_line(const std::vector<std::string>& words, const std::string& line) {
  const auto type_of = [&](const std::string& word) {
    for (const PlyTypeName& known : kPlyTypes)
      if (word == known.name || word == known.other) return known.type;
    fail_here("the header names the type '{}', which PLY does not know: '{}'", word.substr(0, 40), line.substr(0, 80));
  };
  if (words[0] == "comment" && words.size() > 2 && words[1] == "TextureFile") {
    textures_.push_back(line.substr(line.find(words[2], line.find(words[1]) + words[1].size())));
  } else if (words[0] == "format") {
    const std::string form = words.size() > 1 ? words[1] : "";
    if (form != "ascii" && form != "binary_little_endian" && form != "binary_big_endian")
      fail_here("the format '{}' is none of ascii, binary_little_endian, binary_big_endian", form.substr(0, 40));
    text_ = form == "ascii";
    big_endian_ = form == "binary_big_endian";
    format_known_ = true;
  } else if (words[0] == "element") {
    const auto count = words.size() == 3 ? parse_number(words[2]) : std::nullopt;
    if (!count || !(*count >= 0) || *count > static_cast<double>(bytes_.size()))
      fail_here("the header announces '{}', but the file has {} bytes: it is truncated or damaged", line.substr(0, 80),
                bytes_.size());
    elements_.push_back({words[1], static_cast<std::size_t>(*count), {}});
  } else if (words[0] == "property") {
    const bool is_list = words.size() == 5 && words[1] == "list";
    if (elements_.empty() || (!is_list && words.size() != 3))
      fail_here("the header has a line that is no property: '{}'", line.substr(0, 80));
    PlyProperty property{words.back(), type_of(words[words.size() - 2]), is_list, Type::uint8};
    if (is_list) property.count_type = type_of(words[2]);
    if (is_list && ply_is_float(property.count_type))
      fail_here("the length of the list '{}' is not a whole number", property.name.substr(0, 40));
    elements_.back().properties.push_back(property);
  }
}

void PlyFile::check_counts() const {
  double needed = 0;
  for (const PlyElement& element : elements_) {
    if (element.count > 0 && element.properties.empty())
      fail_here("the header announces {} '{}' without properties", element.count, element.name.substr(0, 40));
    needed += static_cast<double>(element.count) * static_cast<double>(smallest_row(element, text_));
  }
  // The last number of a text needs no blank after it.
  if (needed > static_cast<double>(bytes_.size() - at_) + 1)
    fail_here("the file is truncated: its header announces at least {} bytes, {} follow", needed, bytes_.size() - at_);
}

double PlyFile::next_word() {
  const char* const blanks = " \t\r\n";
  const std::size_t begin = bytes_.find_first_not_of(blanks, at_);
  if (begin == std::string::npos) fail_here("the file is truncated: it ends before its last row");
  const std::size_t end = std::min(bytes_.find_first_of(blanks, begin), bytes_.size());
  const std::string_view word = std::string_view(bytes_).substr(begin, end - begin);
  const auto value = parse_number(word);
  if (!value) fail_here("'{}' at byte {} is not a number", word.substr(0, 40), begin);
  at_ = end;
  return *value;
}

double PlyFile::next(Type type) {
  if (text_) return next_word();
  const std::size_t size = ply_size(type);
  if (size > bytes_.size() - at_) fail_here("the file is truncated: it ends before its last row");
  const char* bytes = bytes_.data() + at_;
  at_ += size;
  switch (type) {
    case Type::int8:
      return ply_value<std::int8_t>(bytes, false);
    case Type::uint8:
      return ply_value<std::uint8_t>(bytes, false);
    case Type::int16:
      return ply_value<std::int16_t>(bytes, big_endian_);
    case Type::uint16:
      return ply_value<std::uint16_t>(bytes, big_endian_);
    case Type::int32:
      return ply_value<std::int32_t>(bytes, big_endian_);
    case Type::uint32:
      return ply_value<std::uint32_t>(bytes, big_endian_);
    case Type::float32:
      return ply_value<float>(bytes, big_endian_);
    default:
      return ply_value<double>(bytes, big_endian_);
  }
}

std::size_t PlyFile::next_count(const PlyProperty& list) {
  const double count = next(list.count_type), left = static_cast<double>(bytes_.size() - at_);
  const double most = text_ ? 0.5 * left + 1 : left / static_cast<double>(ply_size(list.type));
  if (!(count >= 0) || count > most)
    fail_here("a list '{}' announces {} numbers, but {} bytes are left: the file is truncated or damaged",
              list.name.substr(0, 40), count, left);
  return static_cast<std::size_t>(count);
}

}  // namespace doppel
