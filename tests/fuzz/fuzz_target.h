#pragma once

#include <filesystem>
#include <functional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "fuzz/wrapping.h"

/// Fuzz targets: readers of files from outside, fed with damaged bytes.
///
/// One target is one reader. `fuzz_driver` runs all targets in every test run, with bytes that it changes by a fixed
/// sequence; `fuzz_libfuzzer` runs one target under libFuzzer. Both are built with the address and undefined-behaviour
/// sanitizers.
namespace doppel::fuzz {

struct FuzzTarget {
  std::string name;
  /// Writes `bytes` into `folder` and reads them. An `Error` is a proper answer. What is accepted must keep the
  /// promises of the reader's header.
  /// @throws Broken for a promise that is not kept; any other exception than doppel::Error is a finding as well
  std::function<void(std::string_view bytes, const std::filesystem::path& folder)> read;
  std::vector<std::string> seeds;       ///< valid files, made by code
  std::vector<std::string> dictionary;  ///< words of the format
  Unwrap unwrap = {};                   ///< of a format that wraps its content
};

/// A promise of a reader that is not kept.
struct Broken : std::logic_error {
  using std::logic_error::logic_error;
};

/// @throws Broken unless `kept`
void promise(bool kept, const std::string& what);

const std::vector<FuzzTarget>& all_targets();
/// @throws Broken for an unknown name, with the known ones
const FuzzTarget& target_of(const std::string& name);

/// Runs a target once. An Error of the reader is swallowed.
/// @return whether the bytes were accepted @throws Broken, or whatever the reader throws beside Error
bool run_once(const FuzzTarget& target, std::string_view bytes, const std::filesystem::path& folder);

/// An input that once broke a reader. It is run in every test run.
struct Regression {
  std::string target;
  std::string what;  ///< what was wrong
  std::string bytes;
};
std::vector<Regression> regressions();

/// Parts of each module, joined by all_targets.
std::vector<FuzzTarget> scene_targets();
std::vector<FuzzTarget> character_targets();
std::vector<FuzzTarget> figure_targets();
std::vector<FuzzTarget> calibration_targets();
std::vector<FuzzTarget> keypoint_targets();
std::vector<FuzzTarget> file_targets();
std::vector<FuzzTarget> network_targets();
std::vector<FuzzTarget> archive_targets();

/// Writes bytes into a file of the folder. @return its path
std::filesystem::path written(std::string_view bytes, const std::filesystem::path& folder, const char* name);

/// Stands between the files of an input that is several files.
inline constexpr const char* kNextFile = "\n#file\n";
/// The files of such an input, exactly `count`; those that it lacks are empty.
std::vector<std::string_view> files_of(std::string_view bytes, std::size_t count);
/// Writes the files of such an input under their names. @return the first one
std::filesystem::path spread(std::string_view bytes, const std::filesystem::path& folder,
                             const std::vector<const char*>& names);
/// The input of these files.
std::string joined(const std::vector<std::string>& files);

/// The bytes of the file that `write` makes at the path it is given, a file `name` in a temporary folder.
std::string bytes_of(const char* name, const std::function<void(const std::filesystem::path&)>& write);

}  // namespace doppel::fuzz
