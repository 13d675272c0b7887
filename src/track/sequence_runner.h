#pragma once

#include <filesystem>
#include <functional>

#include "doppel/core/progress.h"
#include "doppel/track/frame_tracker.h"
#include "doppel/track/tracked_sequence.h"

namespace doppel {

struct SequenceRunOptions {
  int sheet_frames = 0;              ///< rows of `sheet`; 0: none
  std::filesystem::path sheet = {};  ///< JPEG file with outlines of masks and surface in some frames
  int sheet_pixels = 256;            ///< side of the windows in which the sheet finds outlines
  int frames_ahead = 0;              ///< frames that a second thread reads ahead; 0: no second thread
};

/// Reads the frames of a sequence in order and passes them to a tracker. All methods share this class; a method adds
/// its own work with the hook.
class SequenceRunner {
 public:
  /// Called after each frame, on the calling thread.
  using FrameHook = std::function<void(long frame, const FootageFrame& seen, const FrameResult& found)>;

  /// @param footage, tracker must outlive the runner
  SequenceRunner(const Footage& footage, FrameTracker& tracker, SequenceRunOptions options)
      : footage_(footage), tracker_(tracker), options_(std::move(options)) {}

  void on_frame(FrameHook hook) { hook_ = std::move(hook); }

  /// Tracks all frames. @return states, poses and times; the motion is still empty (`make_motion`)
  /// @throws Error when a stop was requested (`stop_requested`)
  TrackedSequence run(const FootageSequence& sequence, Progress& progress);

 private:
  struct Read;
  void track(const Read& read, TrackedSequence& result);

  const Footage& footage_;
  FrameTracker& tracker_;
  SequenceRunOptions options_;
  FrameHook hook_;
};

}  // namespace doppel
