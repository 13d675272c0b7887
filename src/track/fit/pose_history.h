#pragma once

#include <optional>
#include <vector>

#include "doppel/track/energy/root_rotation.h"
#include "doppel/track/fit/tracked_frame.h"

namespace doppel {

/// The poses of the last frames that were found, and the pose predicted from them.
class PoseHistory {
 public:
  /// @param last [D] the last pose until a frame is found
  explicit PoseHistory(std::vector<double> last) : last_(std::move(last)) {}

  bool empty() const { return poses_.empty(); }
  /// The last pose that was found, also after `clear` and `cut`.
  const std::vector<double>& last() const { return last_; }
  /// Adds the pose of a frame. A lost frame empties the history. An initialised or recovered frame starts it again.
  void remember(const TrackedFrame& frame);
  /// Forgets the poses: the next frame is not predicted.
  void clear() { poses_.clear(); }
  /// The next frame begins a new segment.
  void cut();
  /// The state of a frame that was found without a prediction: initialised in a new segment, else recovered.
  FrameState state_of_restart() const { return segment_begins_ ? FrameState::initialised : FrameState::recovered; }
  bool segment_begins() const { return segment_begins_; }
  /// The next pose at constant velocity, from the last two. Where `root` is given, its rotation is extrapolated as a
  /// matrix. @pre not empty()
  std::vector<double> predicted(const std::optional<RootRotation>& root) const;

 private:
  std::vector<std::vector<double>> poses_;  ///< up to two, oldest first
  std::vector<double> last_;
  bool segment_begins_ = true;
};

}  // namespace doppel
