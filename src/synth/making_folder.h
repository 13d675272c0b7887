#pragma once

#include <atomic>
#include <filesystem>
#include <optional>
#include <string>

#include "doppel/core/folder_lock.h"

namespace doppel::synth {

/// The folder in which a capture is made: `.NAME.making` beside the final folder, whose name it gets when it is
/// complete. A run that was stopped or killed leaves it, and the next run of the same work goes on in it.
class MakingFolder {
 public:
  /// @param work what is made; compared with that of a folder which an earlier run has left
  /// @param target a link stays, and the folder that it leads to is replaced
  /// @param force replace a synthetic capture in `target`, and the rest of other work
  /// @throws UsageError when `target` is not empty and not to be replaced, holds what `doppel synth` did not make, is
  /// the current folder or contains it, or leads nowhere as a link; and when other work was left
  /// @throws Error when another process makes this capture
  MakingFolder(const std::filesystem::path& target, const std::string& work, bool force);
  /// Removes the folder if nothing in it is worth keeping.
  ~MakingFolder();
  MakingFolder(const MakingFolder&) = delete;
  MakingFolder& operator=(const MakingFolder&) = delete;

  const std::filesystem::path& path() const { return making_; }
  std::string name() const { return target_.filename().string(); }
  /// Something has been made that the next run need not make again. Any thread may say so.
  void keep() { kept_ = true; }
  /// Gives the complete capture its name.
  void publish();

 private:
  void check_target(bool force);
  /// Takes over what an earlier run has left, or removes it.
  void take_over_rest(const std::string& work, bool force);

  std::filesystem::path target_, making_;
  std::atomic<bool> kept_{false};
  std::optional<FolderLock> lock_;
};

}  // namespace doppel::synth
