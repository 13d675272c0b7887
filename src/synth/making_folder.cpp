#include "doppel/synth/making_folder.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <fstream>
#include <set>
#include <vector>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/folder_path.h"
#include "doppel/core/log.h"
#include "doppel/core/temporary_name.h"
#include "doppel/synth/capture_writer.h"

namespace doppel::synth {

namespace {

namespace fs = std::filesystem;

constexpr char kWorkFile[] = "work.txt";

bool is_synthetic(const fs::path& folder) {
  std::string line;
  std::ifstream readme(folder / "README.txt");
  return fs::exists(folder / "capture.yaml") && std::getline(readme, line) && line.starts_with(kReadmeBeginning);
}

/// The entries of a folder that are not among the known ones; hidden ones are those of file managers and locks.
void find_foreign(const fs::path& folder, const std::set<std::string>& known, std::vector<std::string>& foreign) {
  if (!fs::is_directory(folder)) return;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (!known.contains(name) && !name.starts_with('.')) foreign.push_back(entry.path().string());
  }
}

/// What a synthetic capture does not contain.
std::vector<std::string> foreign_entries(const fs::path& capture) {
  std::vector<std::string> foreign;
  find_foreign(capture,
               {"README.txt", "capture.yaml", kWorkFile, "background", "calibration", "character", "ground_truth",
                "testing", "training"},
               foreign);
  for (const char* sequence : {"training", "testing"})
    find_foreign(capture / sequence, {"foregroundSegmentation", "joints3d", "keypoints", "skeletoolToGTPose", "videos"},
                 foreign);
  std::sort(foreign.begin(), foreign.end());
  return foreign;
}

/// The folder to replace: where a link leads, so that the link stays.
fs::path resolved_folder(const fs::path& written) {
  const fs::path folder = folder_path(fs::absolute(written));
  if (!fs::is_symlink(folder)) return folder;
  if (!fs::exists(folder))
    fail<UsageError>("doppel synth: {} is a link to {}, which does not exist; make that folder, or name another",
                     folder.string(), fs::read_symlink(folder).string());
  return fs::canonical(folder);
}

/// Whether a folder is the current one or contains it.
bool contains_current(const fs::path& folder) {
  if (!fs::exists(folder)) return false;
  const fs::path outer = fs::canonical(folder), inner = fs::current_path();
  return std::mismatch(outer.begin(), outer.end(), inner.begin(), inner.end()).first == outer.end();
}

}  // namespace

MakingFolder::MakingFolder(const fs::path& target, const std::string& work, bool force)
    : target_(resolved_folder(target)) {
  check_target(force);
  making_ = target_.parent_path() / ("." + target_.filename().string() + ".making");
  lock_.emplace(making_);
  take_over_rest(work, force);
  write_atomically(making_ / kWorkFile, work);
}

MakingFolder::~MakingFolder() {
  lock_.reset();
  std::error_code ignored;
  if (!kept_) fs::remove_all(making_, ignored);
}

void MakingFolder::check_target(bool force) {
  if (contains_current(target_))
    fail<UsageError>(
        "doppel synth: {} is the current folder or contains it, and the complete capture takes its place; go to "
        "another folder, or name a new folder with --out",
        target_.string());
  if (!fs::exists(target_) || (fs::is_directory(target_) && fs::is_empty(target_))) return;
  if (!force)
    fail<UsageError>("doppel synth: {} exists and is not empty; name another folder, or give --force",
                     target_.string());
  // Only folders that `doppel synth` made are deleted.
  if (!is_synthetic(target_))
    fail<UsageError>("doppel synth: {} is not a synthetic capture, so --force does not replace it; name another folder",
                     target_.string());
  if (const std::vector<std::string> foreign = foreign_entries(target_); !foreign.empty())
    fail<UsageError>(
        "doppel synth: --force would remove what `doppel synth` did not make: {}; move it away, or name another folder",
        fmt::join(foreign, ", "));
}

void MakingFolder::take_over_rest(const std::string& work, bool force) {
  const fs::path file = making_ / kWorkFile;
  const bool known = fs::exists(file);
  if (known && read_file(file) == work) {
    kept_ = true;
    log::info("continuing the unfinished capture in {}", making_.string());
    remove_temporaries(making_);
    for (const auto& entry : fs::recursive_directory_iterator(making_))
      if (entry.is_directory()) remove_temporaries(entry.path());
    return;
  }
  if (known && !force)
    fail<UsageError>(
        "doppel synth: {} holds an unfinished capture of other options; repeat that command to complete it, or give "
        "--force to remove it",
        making_.string());
  fs::remove(file);  // first, because a folder without this file is never continued
  for (const auto& entry : fs::directory_iterator(making_))
    if (!entry.path().filename().string().starts_with('.')) fs::remove_all(entry.path());
}

void MakingFolder::publish() {
  const fs::path old = making_.string() + "-old";
  fs::remove_all(old);  // of a run that was killed here
  const bool replaces = fs::exists(target_);
  lock_.reset();
  if (replaces) fs::rename(target_, old);
  std::error_code code;
  fs::rename(making_, target_, code);
  if (code) {
    std::error_code ignored;
    if (replaces) fs::rename(old, target_, ignored);
    fail("doppel synth: renaming {} to {}: {}; give the same command again", making_.string(), target_.string(),
         code.message());
  }
  // The capture is complete, so what cannot be removed is no failure.
  fs::remove(target_ / kWorkFile, code);
  if (replaces && !code) fs::remove_all(old, code);
  if (code)
    log::warn("{} or {} could not be removed: {}", (target_ / kWorkFile).string(), old.string(), code.message());
}

}  // namespace doppel::synth
