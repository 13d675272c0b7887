#pragma once

#include <optional>
#include <vector>

#include "doppel/energy/root_rotation.h"
#include "doppel/fit/tracked_frame.h"

namespace doppel {

/// The poses of the last frames that were found, and where they lead.
class PoseHistory {
 public:
  /// @param last [D] counts as the last pose until a frame was found
  explicit PoseHistory(std::vector<double> last) : last_(std::move(last)) {}

  bool empty() const { return poses_.empty(); }
  /// The last pose that was found, however long ago.
  const std::vector<double>& last() const { return last_; }
  /// Adds the pose of a frame. A lost frame empties the history; a frame that did not follow begins it anew.
  void remember(const TrackedFrame& frame);
  /// The next frame does not follow from those before.
  void clear() { poses_.clear(); }
  /// The next frame begins a new segment.
  void cut();
  /// The state of a frame that was found without the history: initialised in a new segment, else recovered.
  FrameState state_of_restart() const { return segment_begins_ ? FrameState::initialised : FrameState::recovered; }
  bool segment_begins() const { return segment_begins_; }
  /// The last two poses, continued at the same speed, turns of the root as matrices where `root` is given. Not to be
  /// asked for while empty.
  std::vector<double> predicted(const std::optional<RootRotation>& root) const;

 private:
  std::vector<std::vector<double>> poses_;  ///< up to two, oldest first
  std::vector<double> last_;
  bool segment_begins_ = true;
};

}  // namespace doppel
