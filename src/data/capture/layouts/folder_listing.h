#pragma once

#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <vector>

namespace doppel {

/// The names of the files in a folder. Paths are relative to `root`, with `/`. Each folder inside is read once, when
/// it is first asked for: a public dataset may hold millions of files that no layout asks for.
class FolderListing {
 public:
  struct Folder {
    std::vector<std::string> files, folders;  ///< names, sorted
  };

  /// @throws Error when `folder` is not a folder
  explicit FolderListing(const std::filesystem::path& folder);

  const std::filesystem::path& root() const { return root_; }  ///< absolute
  std::filesystem::path full(const std::string& path) const { return root_ / path; }
  bool has_file(const std::string& path) const { return std::filesystem::is_regular_file(full(path)); }
  /// What lies in a folder; "": the root. Empty when there is no such folder, or it must not be read.
  const Folder& at(const std::string& path) const;

  /// All files six levels deep, in natural order. Hidden folders, and folders inside that are captures themselves (they
  /// hold a capture.yaml), are left out.
  /// @throws Error for more than 500,000 files
  const std::vector<std::string>& files() const { return walk(), files_; }
  /// The folders that were looked through for `files`, in natural order. "." is the root.
  const std::vector<std::string>& folders() const { return walk(), folders_; }

 private:
  void walk() const;
  void enter(const std::string& folder, int depth, std::set<std::filesystem::path>& seen) const;

  std::filesystem::path root_;
  mutable std::map<std::string, Folder> read_;
  mutable std::vector<std::string> files_, folders_;  ///< empty until asked for
};

}  // namespace doppel
