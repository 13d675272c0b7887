#pragma once

/// A tracked sequence, and the motion and files that every method makes from it.

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "doppel/character/motion.h"
#include "doppel/track/fit/tracked_frame.h"
#include "doppel/track/footage.h"
#include "doppel/track/track_surface.h"

namespace doppel {

/// Seconds, summed over the frames of a sequence.
struct TrackTimes {
  double reading = 0.0, pose = 0.0, surface = 0.0;
  double total = 0.0;  ///< from the first frame to the last; less than the sum where reading runs in parallel

  double fitting() const { return pose + surface; }
};

struct TrackedSequence {
  FootageSequence sequence;
  std::vector<TrackedFrame> frames;  ///< the fitted frames
  TrackTimes times;
  Motion motion;  ///< [last_frame + 1] bridged and smoothed; rows before the first frame repeat it
  std::optional<TrackedSurface> surface;
  std::filesystem::path vertices;  ///< file of the surfaces, float32 [frames,N,3]; empty: none was written

  std::string stopped;  ///< why it ends before the footage does; empty: it does not

  int count(FrameState state) const;
};

/// Fills in `motion` from the poses of all frames: lost frames are bridged, then all are smoothed.
/// @param smoothing, degree as for `smooth_poses` @throws Error when all frames are lost
void make_motion(TrackedSequence& tracked, const std::optional<RootRotation>& root, double smoothing, int degree = 0);

/// Writes `<sequence>.motion` and `<sequence>.bvh` into the folder `out`.
void write_poses(const Character& character, double frames_per_second, const std::filesystem::path& out,
                 const TrackedSequence& tracked);

/// Runs work on the poses of a sequence that is tracked to its end, such as surfaces and films. When a stop is
/// requested, or an image cannot be read, `stopped` says why, and the poses stay.
/// @param work throws an Error then, and leaves no part of a file
void run_second_pass(TrackedSequence& tracked, const std::function<void()>& work);

}  // namespace doppel
