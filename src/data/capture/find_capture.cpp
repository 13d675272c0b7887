#include "doppel/data/capture/find_capture.h"

#include <fmt/ranges.h>

#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/data/capture/layouts/layout_table.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

/// The guess by the first layout that the folder has with all its parts.
/// @param only_sure whether the last resort, which fits every folder, is left out
std::optional<CaptureGuess> first_guess(const fs::path& folder, bool only_sure) {
  const FolderListing listing(folder);
  std::vector<std::string> told;
  for (const FolderLayout& layout : folder_layouts()) {
    if (only_sure && !layout.sure) continue;
    const std::optional<std::string> sign = layout.sign(listing);
    if (!sign) continue;
    const auto doubt = [&](const std::string& reason) {
      told.push_back(fmt::format("the folder looks like {} ({}), but: {}", layout.name, *sign, reason));
    };
    try {
      CaptureGuess guess = layout.guess(listing);
      if (layout.sure && guess.complete) told.push_back(fmt::format("layout of {} ({})", layout.name, *sign));
      if (layout.sure && !guess.complete) {
        doubt(guess.missing.front());
        continue;
      }
      guess.layout = layout.name;
      guess.found.insert(guess.found.begin(), told.begin(), told.end());
      return guess;
    } catch (const Error& e) {
      if (only_sure) throw;
      doubt(e.what());
    }
  }
  return std::nullopt;
}

std::vector<std::string> public_layouts() {
  std::vector<std::string> layouts;
  for (const FolderLayout& layout : folder_layouts())
    if (layout.sure) layouts.push_back(layout.name + ": " + layout.files);
  return layouts;
}

}  // namespace

std::optional<CaptureGuess> recognise_capture(const fs::path& path) {
  const bool is_folder = fs::is_directory(path);
  const std::string extension = path.extension().string();
  if (is_folder ? fs::exists(path / "capture.yaml") : extension == ".yaml" || extension == ".yml")
    return CaptureGuess{"", read_capture(path), {}, {}, true};
  return is_folder ? first_guess(path, true) : std::nullopt;
}

Capture find_capture(const fs::path& path) {
  if (!fs::exists(path)) fail("there is no file or folder {}", path.string());
  if (!fs::is_directory(path)) return read_capture(path);
  std::optional<CaptureGuess> recognised = recognise_capture(path);
  if (!recognised)
    fail(
        "{} has no capture.yaml and is not laid out like a public dataset ({}); let `doppel capture init {}` write a "
        "capture.yaml, or write one as docs/capture.md shows",
        path.string(), fmt::join(public_layouts(), "; "), path.string());
  if (!recognised->layout.empty()) log::info("{}: recognised by its files", path.string());
  for (const std::string& sentence : recognised->found) log::info("  {}", sentence);
  for (const std::string& sentence : recognised->missing) log::info("  missing: {}", sentence);
  return std::move(recognised->capture);
}

CaptureGuess guess_folder(const fs::path& folder) { return first_guess(folder, false).value(); }

}  // namespace doppel
