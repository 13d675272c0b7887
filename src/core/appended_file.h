#pragma once

#include <filesystem>
#include <string>

namespace doppel {

/// A log beside the work: a file that grows by whole records. A write that fails, say on a full disk, does not end the
/// work: there is one warning, and the next record writes what is missing first.
class AppendedFile {
 public:
  /// Opens the file at its end, or makes it. @throws Error when it cannot be opened
  explicit AppendedFile(std::filesystem::path path);
  ~AppendedFile();
  AppendedFile(const AppendedFile&) = delete;
  AppendedFile& operator=(const AppendedFile&) = delete;

  void append(const std::string& record);
  /// Writes what is missing. @throws Error when that fails again
  void finish();

 private:
  /// @return whether nothing is missing
  bool write();

  std::filesystem::path path_;
  int file_ = -1;
  std::string missing_;  ///< bytes that are not yet in the file
  std::string reason_;   ///< of the last failure
};

}  // namespace doppel
