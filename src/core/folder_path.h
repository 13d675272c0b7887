#pragma once

#include <filesystem>

namespace doppel {

/// The normal form of the path of a folder, without a slash at the end, behind which the last part would be empty:
/// "a/b/" and "a/./b" become "a/b".
inline std::filesystem::path folder_path(const std::filesystem::path& path) {
  std::filesystem::path normal = path.lexically_normal();
  return normal.has_filename() ? normal : normal.parent_path();
}

}  // namespace doppel
