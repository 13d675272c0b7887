#pragma once

#include <string>
#include <vector>

#include "doppel/calibration/estimation/outline_tracks.h"
#include "doppel/calibration/estimation/point_tracks.h"
#include "doppel/geometry/camera.h"

namespace doppel {

struct SynchroniseOptions {
  double window = 30.0;            ///< largest change of an offset, in frames of the slower camera of a pair
  int reference = 0;               ///< the camera whose offset and rate are kept
  bool drift = false;              ///< also estimate frame rates relative to the reference
  double kernel = 4.0;             ///< pixels of an image 1024 wide beyond which a residual counts less (Geman-McClure)
  double largest_sigma = 0.25;     ///< frames; an offset that is less certain is "cannot tell"
  double smallest_contrast = 1.2;  ///< least ratio of the second-best minimum of the search to the best
  std::size_t most_times = 400;    ///< times that are compared; more are thinned out
};

/// When the frames of one camera were filmed, as found from the person's motion.
struct CameraTiming {
  std::string name;
  double offset = 0.0;     ///< CameraTrack::offset; the old one when not known
  double fps = 0.0;        ///< CameraTrack::fps; the old one without `drift` or when not known
  double change = 0.0;     ///< offset minus the old offset, frames of this camera
  double sigma = 0.0;      ///< standard deviation of the offset, frames; infinite when the points say nothing
  double fps_sigma = 0.0;  ///< of the frame rate; 0 without `drift`
  double contrast = 0.0;   ///< robust cost of the second-best minimum in the search, over that of the best; 1: equal
  double before = 0.0, after = 0.0;  ///< median epipolar distance to the other cameras, pixels
  bool known = false;                ///< false: cannot tell
  std::string reason;                ///< why it cannot be told; empty when known
};

struct Synchronisation {
  int reference = 0;
  std::vector<CameraTiming> cameras;  ///< [C]; the reference is known, with sigma 0
  double before = 0.0, after = 0.0;   ///< median epipolar distance of all pairs, pixels
};

/// Finds the offsets of the cameras of a rig from the motion of one person. The calibration must be roughly right: a
/// few degrees off are fine. For each pair of cameras, lags of half a frame within the window are compared by their
/// robust Sampson distances, and the cameras are placed one after the other, the clearest first (lag_search.h). All
/// offsets together are then refined to fractions of a frame, with bias terms for the error of the calibration
/// (offset_problem.h). Points that move along the epipolar lines say nothing about time, and the standard deviation
/// grows. Outlines sharpen the fractions by their frontier points, which a detector's noise does not touch.
/// @param tracks with the offsets and rates that are known so far, where the search begins
/// @param outlines [C] with the frames of the tracks; empty: points alone
/// @throws Error as check_tracks, for fewer than two cameras; UsageError for impossible options
Synchronisation synchronise(const std::vector<Camera>& cameras, const PointTracks& tracks,
                            const SynchroniseOptions& options = {}, const std::vector<OutlineTrack>& outlines = {});

/// Writes the known offsets and rates into the tracks.
void apply(const Synchronisation& timing, PointTracks& tracks);

}  // namespace doppel
