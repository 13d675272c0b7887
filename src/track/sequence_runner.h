#pragma once

#include <filesystem>
#include <functional>

#include "doppel/core/progress.h"
#include "doppel/track/frame_tracker.h"
#include "doppel/track/tracked_sequence.h"

namespace doppel {

struct SequenceRunOptions {
  int sheet_frames = 0;              ///< number of frames in the contact sheet, spread over the sequence; 0: no sheet
  std::filesystem::path sheet = {};  ///< file of the contact sheet (TrackSheet), JPEG; needed if sheet_frames is not 0
  int frames_ahead = 0;              ///< largest number of frames that a second thread reads ahead; 0: no second thread
};

/// Reads the frames of a sequence in order and passes them to a tracker. All tracking methods use this class. A method
/// does its own work per frame in a function that it registers with `on_frame`.
class SequenceRunner {
 public:
  /// A function that `run` calls after each frame, on the thread that called `run`.
  /// @param frame row of the resulting motion @param seen what the cameras saw; with images if the tracker uses them,
  /// or if the frame is in the contact sheet @param found the result of the tracker
  using FrameHook = std::function<void(long frame, const FootageFrame& seen, const FrameResult& found)>;

  /// @param footage, tracker must outlive the runner
  SequenceRunner(const Footage& footage, FrameTracker& tracker, SequenceRunOptions options)
      : footage_(footage), tracker_(tracker), options_(std::move(options)) {}

  /// Registers the function to call after each frame. It replaces the one before.
  void on_frame(FrameHook hook) { hook_ = std::move(hook); }

  /// Tracks all frames of a sequence. Calls `FrameTracker::cut` before the first frame and at each cut.
  /// @param sequence of the footage @param progress advances by one for each frame
  /// @return the fitted frames and the times. `motion` is still empty; `make_motion` fills it in. `surface` and
  /// `vertices` are not set.
  /// When a stop is requested (`stop_requested`), or a frame after the first cannot be read, the result ends before it:
  /// `stopped` says why, and `last_frame` of its sequence is the last frame tracked.
  /// @throws Error when a stop was requested before the first frame, when the tracker requires images and a camera has
  /// none, or when the contact sheet cannot be written; also the errors of the footage, the tracker and the hook
  TrackedSequence run(const FootageSequence& sequence, Progress& progress);

 private:
  struct Read;
  void track(const Read& read, TrackedSequence& result);
  static void end_at_last_frame(TrackedSequence& result);

  const Footage& footage_;
  FrameTracker& tracker_;
  SequenceRunOptions options_;
  FrameHook hook_;
};

}  // namespace doppel
