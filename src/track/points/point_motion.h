#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "doppel/calibration/estimation/point_tracks.h"
#include "doppel/data/capture/frame_clock.h"
#include "doppel/geometry/camera.h"

namespace doppel {

struct PointMotionOptions {
  double min_confidence = 0.3;   ///< of a point that counts
  double max_residual = 16.0;    ///< of an agreeing view, pixels of an image whose longer side is 1024
  double kernel = 16.0;          ///< residual beyond which a view counts less (triangulate), in the same pixels; from
                                 ///< 2.5 times as many, a view does not count
  double longest_gap = 0.2;      ///< seconds that are filled by interpolation
  double smoothing = 1.0 / 30.;  ///< seconds: sigma of the local parabola (smooth_poses); 0: none
};

/// How well one camera agrees with the points in space.
struct PointCamera {
  std::string name;
  long seen = 0;             ///< points of at least min_confidence, over all frames, that have a position in space
  long agreeing = 0;         ///< of these, within max_residual
  double residual_px = 0.0;  ///< mean distance of the agreeing points from the projections, pixels as filmed
};

/// Points of one person in space over time.
struct PointMotion {
  using Frame = std::vector<std::optional<Eigen::Vector3d>>;  ///< [K] world metres; nothing: not found

  std::vector<std::string> points;   ///< [K] names
  double fps = 25.0;                 ///< frames per second
  long first_row = 0;                ///< row of the motion of the first frame
  std::vector<Frame> frames;         ///< [F]
  std::vector<PointCamera> cameras;  ///< [C]
  long filled = 0;                   ///< points that were interpolated between found ones

  /// The share of points that have a position, over all frames.
  double found() const;
};

/// Triangulates every point of every row robustly (triangulate, with a kernel), weighted by the confidences. A point
/// needs two agreeing views. No body is known: limbs may change their lengths.
/// @param cameras [C] in the order of the tracks, with their lenses @param clocks [C] of the rows
/// @throws Error for another number of cameras
PointMotion triangulate_tracks(const PointTracks& tracks, const std::vector<Camera>& cameras,
                               const std::vector<FrameClock>& clocks, double fps, long first_row, long last_row,
                               const PointMotionOptions& options = {});

/// Fills gaps of up to `longest_gap` by straight lines, then smooths each run of frames without a gap.
/// @param cuts frames that begin a segment, counted from the first; nothing is filled or smoothed across them
void fill_and_smooth(PointMotion& motion, const std::vector<long>& cuts, const PointMotionOptions& options);

}  // namespace doppel
