#include "doppel/synth/making_folder.h"

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/folder_path.h"
#include "doppel/core/log.h"
#include "doppel/core/temporary_name.h"

namespace doppel::synth {

namespace {

namespace fs = std::filesystem;

constexpr char kWorkFile[] = "work.txt";

}  // namespace

MakingFolder::MakingFolder(const fs::path& target, const std::string& work, bool force)
    : target_(folder_path(fs::absolute(target))) {
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
  if (!fs::exists(target_) || (fs::is_directory(target_) && fs::is_empty(target_))) return;
  if (!force)
    fail<UsageError>("doppel synth: {} exists and is not empty; name another folder, or give --force",
                     target_.string());
  // Only folders that `doppel synth` made are deleted.
  if (!fs::exists(target_ / "capture.yaml") || !fs::exists(target_ / "ground_truth"))
    fail<UsageError>("doppel synth: {} is not a synthetic capture, so --force does not replace it; name another folder",
                     target_.string());
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
