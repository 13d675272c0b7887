#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "doppel/core/error.h"

namespace doppel {

/// The separator between the tokens of a line: a run of blanks and tabs, or one comma. With commas, blanks around a
/// token are dropped, a token may be empty, and quotation marks have no meaning.
enum class Separator { blanks, comma };

/// Lengths in files of people and their rooms are far below this one, and products of two of them are finite.
inline constexpr double kMaxMetres = 1e9;

/// Reads the line-based text formats of the field (Skeletool files, OBJ, tables) with `file:line` in every error.
///
/// Lines may end in LF or CRLF. A UTF-8 byte order mark is skipped. A NUL byte is an error ("not a text file"), and so
/// is a file that is missing or empty.
class TextReader {
 public:
  /// Reads the whole file `path`. `what` names the kind of file in messages ("a skeleton file").
  TextReader(const std::filesystem::path& path, std::string what, Separator separator = Separator::blanks);

  /// Moves to the next line that holds a token. False at the end of the file.
  bool next_line();
  /// As `next_line`, but the end of the file is an error: "ends where <expected> should stand".
  void require_line(std::string_view expected);
  /// Moves to the next line that holds a token. The line must be the table header `header`; blanks around names are
  /// ignored.
  void require_header(std::string_view header);
  /// As `next_line`, but a line whose number of tokens is not `columns` is an error.
  bool next_row(std::size_t columns);

  /// The current line without its end-of-line characters and outer blanks, and its tokens.
  std::string_view line() const { return line_; }
  const std::vector<std::string_view>& tokens() const { return tokens_; }

  /// A token of the current line as a number. `what` names it in messages.
  /// @throws FileError when the token is missing, is not entirely a number, or is not finite
  double number(std::size_t token, std::string_view what) const;
  /// As `number`, for a length in units of `metres_per_unit`. @return metres
  /// @throws FileError also for more than kMaxMetres
  double length(std::size_t token, std::string_view what, double metres_per_unit) const;
  /// A token as an integer, which must lie in [minimum, maximum].
  long integer(std::size_t token, std::string_view what, long minimum, long maximum) const;

  /// A count of items from a header. It is checked before anything is allocated: the rest of the file must hold at
  /// least one byte per item.
  /// @throws FileError for a negative or impossible count
  std::size_t count(std::size_t token, std::string_view what) const;

  const FileLocation& where() const { return where_; }
  const std::filesystem::path& path() const { return path_; }
  template <typename... Args>
  [[noreturn]] void fail_here(fmt::format_string<Args...> format, Args&&... args) const {
    fail_at(where_, format, std::forward<Args>(args)...);
  }

 private:
  std::filesystem::path path_;
  std::string what_;
  Separator separator_;
  std::string content_;
  std::size_t position_ = 0;
  FileLocation where_;
  std::string_view line_;
  std::vector<std::string_view> tokens_;
};

/// `text` as a number, if all of it is a number (C locale; NaN and infinity count as numbers here).
std::optional<double> parse_number(std::string_view text);

/// Resolves a path written in another file (with / or \, perhaps a leading ./) relative to the folder of that file.
std::filesystem::path resolve_path(const std::filesystem::path& referring_file, std::string_view written);

}  // namespace doppel
