#pragma once

#include <filesystem>

namespace doppel {

/// A new folder for files in the making. The folder and its content are removed at the end. Files can be renamed from
/// it to folders on the same disk, so `parent` should be beside these folders.
class ScratchFolder {
 public:
  /// @throws Error when no folder can be made in `parent`
  explicit ScratchFolder(const std::filesystem::path& parent = std::filesystem::temp_directory_path());
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace doppel
