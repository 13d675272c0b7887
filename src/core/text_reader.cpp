#include "doppel/core/text_reader.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>

#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/excerpt.h"

namespace doppel {
namespace {

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f'; }

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

void split(std::string_view line, std::vector<std::string_view>& tokens) {
  tokens.clear();
  for (std::size_t begin = 0; begin < line.size();) {
    if (is_blank(line[begin])) {
      ++begin;
      continue;
    }
    std::size_t end = begin;
    while (end < line.size() && !is_blank(line[end])) ++end;
    tokens.push_back(line.substr(begin, end - begin));
    begin = end;
  }
}

void split_at_commas(std::string_view line, std::vector<std::string_view>& tokens) {
  tokens.clear();
  for (std::size_t begin = 0, end = 0; end != std::string_view::npos; begin = end + 1) {
    end = line.find(',', begin);
    tokens.push_back(trimmed(line.substr(begin, end == std::string_view::npos ? end : end - begin)));
  }
}

/// Removes a plus sign, which some writers print but from_chars rejects.
std::string_view without_plus(std::string_view text) {
  if (text.size() > 1 && text[0] == '+' && text[1] != '-' && text[1] != '+') text.remove_prefix(1);
  return text;
}

}  // namespace

std::optional<double> parse_number(std::string_view text) {
  text = without_plus(text);
  double value = 0;
  const char* const end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, value);
  if (text.empty() || rest != end) return std::nullopt;
  if (error == std::errc::result_out_of_range) {
    // from_chars does not report the side of the overflow. A tiny number becomes zero; a huge number is rejected.
    const std::size_t exponent = text.find_first_of("eE");
    const bool tiny = exponent != std::string_view::npos ? text.substr(exponent + 1, 1) == "-" : text.size() > 300;
    if (!tiny) return std::nullopt;
    return 0.0;
  }
  if (error != std::errc()) return std::nullopt;
  return value;
}

std::filesystem::path resolve_path(const std::filesystem::path& referring_file, std::string_view written) {
  std::string text(written);
  std::replace(text.begin(), text.end(), '\\', '/');
  return (referring_file.parent_path() / text).lexically_normal();
}

TextReader::TextReader(const std::filesystem::path& path, std::string what, Separator separator)
    : path_(path), what_(std::move(what)), separator_(separator), where_{path.string(), 0} {
  content_ = read_file(path);
  if (content_.compare(0, 3, "\xEF\xBB\xBF") == 0) position_ = 3;
  const std::size_t nul = content_.find('\0');
  if (nul != std::string::npos) {
    where_.line =
        1 + static_cast<int>(std::count(content_.begin(), content_.begin() + static_cast<std::ptrdiff_t>(nul), '\n'));
    fail_here("reading {}: this is not a text file (found a NUL byte)", what_);
  }
  if (content_.find_first_not_of(" \t\r\n\v\f", position_) == std::string::npos)
    fail_here("reading {}: the file is empty", what_);
}

bool TextReader::next_line() {
  while (position_ < content_.size()) {
    std::size_t end = content_.find('\n', position_);
    if (end == std::string::npos) end = content_.size();
    line_ = trimmed(std::string_view(content_).substr(position_, end - position_));
    position_ = std::min(end + 1, content_.size());
    ++where_.line;
    if (!line_.empty()) {
      separator_ == Separator::comma ? split_at_commas(line_, tokens_) : split(line_, tokens_);
      return true;
    }
  }
  line_ = {};
  tokens_.clear();
  return false;
}

void TextReader::require_line(std::string_view expected) {
  if (!next_line()) fail_here("reading {}: the file ends where {} should stand", what_, expected);
}

void TextReader::require_header(std::string_view header) {
  require_line(fmt::format("the line '{}'", header));
  std::vector<std::string_view> names;
  separator_ == Separator::comma ? split_at_commas(header, names) : split(header, names);
  if (names != tokens_) fail_here("reading {}: the first line must be '{}', found '{}'", what_, header, excerpt(line_));
}

bool TextReader::next_row(std::size_t columns) {
  if (!next_line()) return false;
  if (tokens_.size() != columns)
    fail_here("reading {}: the line has {} columns, the table has {}", what_, tokens_.size(), columns);
  return true;
}

double TextReader::number(std::size_t token, std::string_view what) const {
  if (token >= tokens_.size()) {
    fail_here("reading {}: {} is missing (found {} of at least {} tokens on this line)", what_, what, tokens_.size(),
              token + 1);
  }
  const std::optional<double> value = parse_number(tokens_[token]);
  if (!value) fail_here("reading {}: {} must be a number, found \"{}\"", what_, what, excerpt(tokens_[token]));
  if (!std::isfinite(*value))
    fail_here("reading {}: {} must be finite, found \"{}\"", what_, what, excerpt(tokens_[token]));
  return *value;
}

double TextReader::length(std::size_t token, std::string_view what, double metres_per_unit) const {
  const double metres = number(token, what) * metres_per_unit;
  if (!(std::abs(metres) <= kMaxMetres))
    fail_here("reading {}: {} is {} m, allowed are {:g} m; is the unit right?", what_, what, metres, kMaxMetres);
  return metres;
}

long TextReader::integer(std::size_t token, std::string_view what, long minimum, long maximum) const {
  if (token >= tokens_.size()) {
    fail_here("reading {}: {} is missing (found {} of at least {} tokens on this line)", what_, what, tokens_.size(),
              token + 1);
  }
  const std::string_view text = without_plus(tokens_[token]);
  long value = 0;
  const auto [rest, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (rest != text.data() + text.size() || error == std::errc::invalid_argument) {
    fail_here("reading {}: {} must be an integer, found \"{}\"", what_, what, excerpt(tokens_[token]));
  }
  if (error != std::errc() || value < minimum || value > maximum) {
    fail_here("reading {}: {} is {}, allowed is {} to {}", what_, what, excerpt(tokens_[token]), minimum, maximum);
  }
  return value;
}

std::size_t TextReader::count(std::size_t token, std::string_view what) const {
  const long left = static_cast<long>(content_.size() - position_ + line_.size());
  const long value = integer(token, what, std::numeric_limits<long>::min(), std::numeric_limits<long>::max());
  if (value < 0) fail_here("reading {}: {} is {}, a count cannot be negative", what_, what, value);
  if (value > left) {
    fail_here("reading {}: {} is {}, but only {} bytes are left in the file; it is truncated or the count is wrong",
              what_, what, value, left);
  }
  return as_size(value);
}

}  // namespace doppel
