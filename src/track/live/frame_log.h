#pragma once

#include <atomic>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "doppel/track/fit/tracked_frame.h"

namespace doppel {

/// The poses of a live run, which may go on for hours: they are in a file without a name, so that memory does not grow.
/// The file is on the disk of the results, and ends with the process.
class FrameLog {
 public:
  /// @param folder of the results @throws FileError when no file can be made there
  explicit FrameLog(std::filesystem::path folder);

  /// Keeps all of a frame but the costs of the terms. @throws FileError, say for a full disk; the frames before stay
  void append(const TrackedFrame& frame);
  /// Other threads may ask, too.
  std::size_t size() const { return size_; }
  /// All frames. @throws FileError
  std::vector<TrackedFrame> read();

 private:
  struct Record;
  void take(void* bytes, std::size_t size);

  std::filesystem::path folder_;
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_;
  std::string bytes_;  ///< of the last frame
  std::atomic<std::size_t> size_{0};
};

}  // namespace doppel
