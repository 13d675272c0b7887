#pragma once

#include <Eigen/Core>

#include "doppel/calibration/estimation/point_tracks.h"

namespace doppel {

/// A point at a fractional frame, and how fast it moves.
struct MovingPoint {
  bool seen = false;     ///< three frames near enough see the point
  bool between = false;  ///< and these lie on both sides
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  Eigen::Vector2d velocity = Eigen::Vector2d::Zero();  ///< pixels per frame
};

/// The weighted straight line through the points of neighbouring frames, at a fractional frame. The weights are
/// confidence^2 (1 - (x / 3 width)^2)^3: they fall to 0 smoothly, so that a frame which enters the window changes
/// nothing. Linear interpolation would not do for synchronisation: its noise is smallest in the middle between two
/// frames, which draws every estimate there.
/// @param width frames; about the standard deviation of the weights
MovingPoint smooth_sample(const CameraTrack& track, double frame, int point, double width);

/// The track with every point replaced by its smooth sample; points that are not between others are not seen.
CameraTrack smooth_track(const CameraTrack& track, double width);

/// Takes out points that are farther than `limit` pixels from the median of the two frames before, the frame itself and
/// the two frames after it, per coordinate. Points that are seen in fewer than three of these frames go too.
void drop_jumps(CameraTrack& track, double limit);

}  // namespace doppel
