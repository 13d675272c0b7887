#pragma once

#include <filesystem>

namespace doppel {

/// Lets one process at a time write into a folder, by `flock` on a file in it. The system releases the lock when its
/// process ends, in whatever way; a file that a killed process left does no harm. A file system without locks gives a
/// warning. What a killed process left half written in the folder is removed (temporary_name.h).
class FolderLock {
 public:
  /// Makes a missing folder. @throws Error when another process holds the lock, naming it and its machine, or when the
  /// folder cannot be written
  explicit FolderLock(const std::filesystem::path& folder);
  /// Removes the lock's file, and the folder if this object made it and it is empty.
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  std::filesystem::path folder_;
  bool made_folder_ = false;
  int file_ = -1;
};

/// Whether a folder is missing, or holds nothing but a lock.
bool is_unused_folder(const std::filesystem::path& folder);

}  // namespace doppel
