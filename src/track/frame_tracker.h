#pragma once

#include "doppel/track/energy/pose_model.h"
#include "doppel/track/fit/tracked_frame.h"
#include "doppel/track/footage.h"

namespace doppel {

/// Which images a tracker reads of each frame.
enum class ImageUse {
  none,
  optional,  ///< uses an image where there is one
  required
};

/// Tracks frame by frame; the interface of all methods. The tracker starts from the last poses and judges the result by
/// its inliers. When the frame is lost, it starts again from the evidence alone.
class FrameTracker {
 public:
  virtual ~FrameTracker() = default;

  /// Tracks the next frame. @param seen with images as `image_use` says
  virtual FrameResult track(const FootageFrame& seen) = 0;
  /// The next frame begins a new segment.
  virtual void cut() = 0;
  /// Frames are missing before the next one. The person is the same: the next state is `recovered`, not `initialised`.
  virtual void pause() = 0;

  virtual ImageUse image_use() const = 0;
  virtual const PoseModel& model() const = 0;
};

}  // namespace doppel
