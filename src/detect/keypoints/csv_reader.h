#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "doppel/core/error.h"

namespace doppel {

/// The cells of one line. The separator is the semicolon, the tab or the comma, whichever the line has most of outside
/// of quotation marks.
std::vector<std::string> csv_cells(std::string_view line);

/// A text as a cell of a table with commas: in quotation marks where it needs them.
std::string csv_cell(const std::string& text);

/// The first line of a table that names its columns: without byte order mark, after empty lines and `sep=;`.
std::string_view csv_header(std::string_view text);

/// A name of a column as readers compare it: small letters and digits. "Joint_Name" is "jointname".
std::string plain_column(std::string_view name);

/// Reads a table of separated values as spreadsheets, R and pandas write it, with `file:line` in every error.
/// - The header decides the separator, or a line `sep=;` before it. Empty lines are skipped.
/// - Cells may stand in quotation marks; two in a row stand for one. A cell ends on its line.
/// - A comma in a number is its decimal point: in a cell in quotation marks, or where another separator is used.
/// - Rows may have an empty cell more than the header, or their number in front, as R's write.table writes it.
class CsvReader {
 public:
  /// @param what the kind of file for messages ("a table of keypoints") @throws FileError without any line
  CsvReader(const std::filesystem::path& path, std::string what);

  const std::vector<std::string>& header() const { return header_; }
  /// Moves to the next line that is not empty. False at the end of the file.
  bool next_line();
  /// The same; @throws FileError for another number of cells than the header has
  bool next_row();

  const std::vector<std::string>& cells() const { return cells_; }
  /// NaN for a missing value: empty, NA, NaN, null, None. @throws FileError for what is no number
  double number(std::size_t column) const;
  /// @throws FileError for what is no integer from 0
  long integer(std::size_t column, std::string_view what) const;

  template <typename... Args>
  [[noreturn]] void fail_here(fmt::format_string<Args...> format, Args&&... args) const {
    fail_at(where_, format, std::forward<Args>(args)...);
  }

 private:
  std::string_view next_text();
  void split(std::string_view line);

  std::string what_, content_;
  std::size_t position_ = 0;
  FileLocation where_;
  char separator_ = ',';
  std::vector<std::string> header_, cells_;
  long rows_ = 0;
};

}  // namespace doppel
