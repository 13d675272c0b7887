#include "doppel/detect/keypoints/csv_reader.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <climits>
#include <cmath>

#include "doppel/core/atomic_file.h"
#include "doppel/core/excerpt.h"
#include "doppel/core/text_reader.h"

namespace doppel {

namespace {

constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
constexpr double kMaxCell = 1e7;

std::string_view without_blanks(std::string_view text, std::string_view blanks) {
  const std::size_t begin = text.find_first_not_of(blanks);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(blanks) + 1 - begin);
}

/// Tabs at the ends of a line may separate cells.
bool is_empty_line(std::string_view line) { return without_blanks(line, " \t\r\v\f").empty(); }

/// `sep=;` before the header, as spreadsheets understand it; 0: none.
char stated_separator(std::string_view line) {
  line = without_blanks(line, " \r\"");
  return line.size() == 5 && line.starts_with("sep=") ? line.back() : '\0';
}

char usual_separator(std::string_view line) {
  std::array<int, 3> counts{};
  constexpr std::string_view separators = ";\t,";
  bool quoted = false;
  for (const char c : line) {
    quoted ^= c == '"';
    const std::size_t which = quoted ? std::string_view::npos : separators.find(c);
    if (which != std::string_view::npos) ++counts[which];
  }
  const auto most = std::max_element(counts.begin(), counts.end());
  return *most == 0 ? ',' : separators[static_cast<std::size_t>(most - counts.begin())];
}

/// @param closed whether every quotation mark has its partner
std::vector<std::string> cells_of(std::string_view line, char separator, bool& closed) {
  std::vector<std::string> cells;
  std::string cell;
  bool quoted = false, was_quoted = false;
  const auto end_cell = [&] {
    cells.emplace_back(was_quoted ? cell : std::string(without_blanks(cell, " \t\r\v\f")));
    cell.clear();
    was_quoted = false;
  };
  for (std::size_t i = 0; i < line.size(); ++i) {
    const char c = line[i];
    if (quoted && c == '"' && i + 1 < line.size() && line[i + 1] == '"') {
      cell += line[i++];
    } else if (c == '"' && (quoted || is_empty_line(cell))) {
      if (!quoted) cell.clear();
      quoted = !quoted;
      was_quoted = true;
    } else if (c == separator && !quoted) {
      end_cell();
    } else if (quoted || !was_quoted) {  // blanks after a quotation mark do not count
      cell += c;
    }
  }
  closed = !quoted;
  end_cell();
  return cells;
}

bool is_missing(std::string_view cell) {
  const std::string plain = plain_column(cell);
  return cell.empty() || plain == "na" || plain == "nan" || plain == "null" || plain == "none";
}

/// A number with a point or, unless the cell also holds a point, one comma.
std::optional<double> cell_number(std::string cell) {
  if (cell.find('.') == std::string::npos && std::count(cell.begin(), cell.end(), ',') == 1)
    std::replace(cell.begin(), cell.end(), ',', '.');
  return parse_number(cell);
}

}  // namespace

std::vector<std::string> csv_cells(std::string_view line) {
  bool closed = true;
  return cells_of(line, usual_separator(line), closed);
}

std::string csv_cell(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos && text == without_blanks(text, " \t\v\f")) return text;
  std::string cell = "\"";
  for (const char c : text) cell += c == '"' ? std::string("\"\"") : std::string(1, c);
  return cell + "\"";
}

std::string_view csv_header(std::string_view text) {
  if (text.starts_with(kByteOrderMark)) text.remove_prefix(kByteOrderMark.size());
  while (!text.empty()) {
    const std::string_view line = text.substr(0, text.find('\n'));
    if (!is_empty_line(line) && stated_separator(line) == '\0') return line.substr(0, line.find('\r'));
    text.remove_prefix(std::min(line.size() + 1, text.size()));
  }
  return {};
}

std::string plain_column(std::string_view name) {
  std::string plain;
  for (const char c : name)
    if (std::isalnum(static_cast<unsigned char>(c)) != 0)
      plain += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return plain;
}

CsvReader::CsvReader(const std::filesystem::path& path, std::string what)
    : what_(std::move(what)), content_(read_file(path)), where_{path.string(), 0} {
  if (content_.starts_with(kByteOrderMark)) position_ = kByteOrderMark.size();
  const std::size_t nul = content_.find('\0');
  if (nul != std::string::npos) {
    where_.line =
        1 + static_cast<int>(std::count(content_.begin(), content_.begin() + static_cast<std::ptrdiff_t>(nul), '\n'));
    fail_here("reading {}: this is not a text file (found a NUL byte)", what_);
  }
  std::string_view line = next_text();
  const char stated = stated_separator(line);
  if (stated != '\0') line = next_text();
  if (line.empty()) fail_here("reading {}: the file has no line that names the columns", what_);
  separator_ = stated != '\0' ? stated : usual_separator(line);
  split(line);
  header_ = cells_;
}

/// Empty at the end of the file.
std::string_view CsvReader::next_text() {
  while (position_ < content_.size()) {
    const std::size_t end = std::min(content_.find('\n', position_), content_.size());
    const std::string_view line = std::string_view(content_).substr(position_, end - position_);
    position_ = std::min(end + 1, content_.size());
    ++where_.line;
    if (!is_empty_line(line)) return line;
  }
  return {};
}

void CsvReader::split(std::string_view line) {
  bool closed = true;
  cells_ = cells_of(line, separator_, closed);
  if (!closed) fail_here("reading {}: a quotation mark is not closed on its line", what_);
}

bool CsvReader::next_line() {
  const std::string_view line = next_text();
  cells_.clear();
  if (line.empty()) return false;
  split(line);
  ++rows_;
  return true;
}

bool CsvReader::next_row() {
  if (!next_line()) return false;
  if (cells_.size() == header_.size() + 1) {
    if (cells_.back().empty())
      cells_.pop_back();
    else if (cells_.front() == std::to_string(rows_))
      cells_.erase(cells_.begin());
  }
  if (cells_.size() != header_.size())
    fail_here("reading {}: the line has {} columns, the table has {}, separated by '{}'", what_, cells_.size(),
              header_.size(), separator_ == '\t' ? std::string("tab") : std::string(1, separator_));
  return true;
}

double CsvReader::number(std::size_t column) const {
  const std::string& cell = cells_[column];
  if (is_missing(cell)) return std::nan("");
  const std::optional<double> value = cell_number(cell);
  if (!value || !std::isfinite(*value))
    fail_here("reading {}: column {} ({}) holds '{}', a number is expected", what_, column + 1,
              excerpt(header_[column]), excerpt(cell));
  if (std::abs(*value) > kMaxCell)
    fail_here("reading {}: column {} ({}) holds {}, which lies in no image", what_, column + 1,
              excerpt(header_[column]), excerpt(cell));
  return *value;
}

long CsvReader::integer(std::size_t column, std::string_view what) const {
  const std::optional<double> value = cell_number(cells_[column]);
  if (!value || *value < 0 || *value > INT_MAX || *value != std::floor(*value))
    fail_here("reading {}: {} must be an integer from 0, found \"{}\"", what_, what, excerpt(cells_[column]));
  return static_cast<long>(*value);
}

}  // namespace doppel
