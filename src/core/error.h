#pragma once

#include <fmt/format.h>

#include <stdexcept>
#include <string>

namespace doppel {

/// The base of all exceptions that Doppel throws on purpose. The message says, in this order: what was being done,
/// what was found, what is allowed, and how to correct it. The program prints the message unchanged and exits with 1.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Wrong use of the program or of an interface (unknown option, value out of range): exit code 2.
class UsageError : public Error {
 public:
  using Error::Error;
};

/// A location in a text file, printed as `file:line`, or as `file` when `line` is 0.
struct FileLocation {
  std::string file;
  int line = 0;  ///< counted from 1; 0 = the file as a whole

  std::string to_string() const { return line > 0 ? fmt::format("{}:{}", file, line) : file; }
};

/// A file that cannot be used in its present form. The message begins with the location.
class FileError : public Error {
 public:
  FileError(const FileLocation& where, const std::string& message)
      : Error(where.to_string() + ": " + message), location(where) {}

  FileLocation location;
};

/// Throws `E` with a formatted message: `fail("expected {} DoFs, found {}", 33, 12)`.
template <typename E = Error, typename... Args>
[[noreturn]] void fail(fmt::format_string<Args...> format, Args&&... args) {
  throw E(fmt::format(format, std::forward<Args>(args)...));
}

/// Throws `FileError` at `where` with a formatted message.
template <typename... Args>
[[noreturn]] void fail_at(const FileLocation& where, fmt::format_string<Args...> format, Args&&... args) {
  throw FileError(where, fmt::format(format, std::forward<Args>(args)...));
}

}  // namespace doppel
