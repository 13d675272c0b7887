#include "doppel/track/live/frame_log.h"

#include <cerrno>
#include <cstring>

#include "doppel/core/error.h"
#include "doppel/core/temporary_name.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

[[noreturn]] void fail_with_reason(const fs::path& folder, const char* action) {
  fail_at({folder.string(), 0}, "{} the poses of the live run: {}", action, std::strerror(errno));
}

}  // namespace

/// A frame without its terms; its DoFs follow.
struct FrameLog::Record {
  std::size_t num_dofs = 0;
  FrameState state = FrameState::lost;
  ConvergenceReason reason = ConvergenceReason::iteration_limit;
  int keypoints = 0, iterations = 0;
  double inlier_ratio = 0.0, keypoint_error = 0.0;
};

FrameLog::FrameLog(fs::path folder) : folder_(std::move(folder)), file_(nullptr, std::fclose) {
  const fs::path name = temporary_beside(folder_ / "live.poses");
  file_.reset(std::fopen(name.c_str(), "w+b"));
  if (!file_) fail_with_reason(folder_, "writing");
  fs::remove(name);
  std::setvbuf(file_.get(), nullptr, _IONBF, 0);
}

void FrameLog::append(const TrackedFrame& frame) {
  const Record record{frame.dofs.size(), frame.state,        frame.reason,        frame.keypoints,
                      frame.iterations,  frame.inlier_ratio, frame.keypoint_error};
  bytes_.assign(reinterpret_cast<const char*>(&record), sizeof record);
  bytes_.append(reinterpret_cast<const char*>(frame.dofs.data()), frame.dofs.size() * sizeof(double));
  if (std::fwrite(bytes_.data(), 1, bytes_.size(), file_.get()) != bytes_.size()) fail_with_reason(folder_, "writing");
  ++size_;
}

std::vector<TrackedFrame> FrameLog::read() {
  std::rewind(file_.get());
  std::vector<TrackedFrame> frames(size_);
  for (TrackedFrame& frame : frames) {
    Record record;
    take(&record, sizeof record);
    frame.dofs.resize(record.num_dofs);
    take(frame.dofs.data(), record.num_dofs * sizeof(double));
    frame.state = record.state;
    frame.reason = record.reason;
    frame.keypoints = record.keypoints;
    frame.iterations = record.iterations;
    frame.inlier_ratio = record.inlier_ratio;
    frame.keypoint_error = record.keypoint_error;
  }
  return frames;
}

void FrameLog::take(void* bytes, std::size_t size) {
  if (std::fread(bytes, 1, size, file_.get()) != size) fail_with_reason(folder_, "reading");
}

}  // namespace doppel
