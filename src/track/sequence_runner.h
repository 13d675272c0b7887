#pragma once

#include <filesystem>
#include <functional>

#include "doppel/core/progress.h"
#include "doppel/track/frame_tracker.h"
#include "doppel/track/tracked_sequence.h"

namespace doppel {

struct SequenceRunOptions {
  int sheet_frames = 0;                  ///< rows of `sheet`; 0: none
  std::filesystem::path sheet = {};      ///< the JPEG file of outlines of masks and surface in some frames
  int sheet_pixels = 256;                ///< side of the windows in which the sheet finds outlines
  int frames_ahead = 0;                  ///< frames that a second thread reads ahead; 0: no second thread
};

/// Reads the frames of a sequence in order and hands them to a tracker: what all methods have in common. A method adds
/// its own work by the hook.
class SequenceRunner {
 public:
  /// Called after each frame, on the calling thread.
  using FrameHook = std::function<void(long frame, const FootageFrame& seen, const FrameResult& found)>;

  /// @param footage, tracker must outlive the runner
  SequenceRunner(const Footage& footage, FrameTracker& tracker, SequenceRunOptions options)
      : footage_(footage), tracker_(tracker), options_(std::move(options)) {}

  void on_frame(FrameHook hook) { hook_ = std::move(hook); }

  /// Tracks all frames. @return states, poses and times; no motion yet (`make_motion`)
  /// @throws Error when a stop was asked for
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
