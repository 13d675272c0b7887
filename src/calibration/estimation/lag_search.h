#pragma once

#include <vector>

#include "doppel/calibration/estimation/point_tracks.h"
#include "doppel/geometry/camera.h"

namespace doppel {

/// The cost of a pair of cameras over lags: the mean robust Sampson distance, between 0 and 1.
struct LagCurve {
  int a = 0, b = 0;
  std::vector<double> costs;  ///< [2 n + 1] at the lags (i - n) * step; a positive lag samples b later
  double samples = 0.0;       ///< largest number of samples at one lag
  double scale = 0.0;         ///< of the robust kernel, pixels of an image 1024 wide
};

struct LagSearchOptions {
  double step = 0.02;   ///< seconds between two lags
  int steps = 60;       ///< lags on each side that a camera may be moved by
  int guard = 6;        ///< steps around the best lag that belong to its minimum
  double kernel = 4.0;  ///< smallest scale of the robust kernel, pixels of an image 1024 wide
  int reference = 0;    ///< camera that is not moved
};

/// How far one camera has to be moved.
struct FoundLag {
  bool reached = false;   ///< false: it shares no points with the other cameras
  int step = 0;           ///< lag in steps
  double contrast = 1.0;  ///< the lowest cost outside of the minimum over that of the minimum
};

/// The lag of every camera. Beginning with the reference, the camera with the clearest minimum over all cameras that
/// were placed is placed next; then each camera is placed again with respect to all others.
/// @param tracks without lens distortion
std::vector<FoundLag> search_lags(const std::vector<Camera>& cameras, const PointTracks& tracks,
                                  const LagSearchOptions& options);

}  // namespace doppel
