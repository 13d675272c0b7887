#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <vector>

#include "doppel/geometry/camera.h"

namespace doppel {

/// A point of the person in one image.
struct TrackPoint {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  ///< as filmed, with distortion
  double confidence = 0.0;                          ///< 0: not seen

  bool seen() const { return confidence > 0.0; }
};

/// What one camera saw of the person: K points in each of F frames, and when its frames were filmed.
class CameraTrack {
 public:
  CameraTrack() = default;
  CameraTrack(std::string camera, double frames_per_second, long num_frames, int num_points);

  std::string name;
  double fps = 25.0;    ///< frames per second
  double offset = 0.0;  ///< the frame of this camera, possibly fractional, at the common time 0

  long num_frames() const { return num_frames_; }
  int num_points() const { return num_points_; }
  TrackPoint& at(long frame, int point) { return points_[index(frame, point)]; }
  const TrackPoint& at(long frame, int point) const { return points_[index(frame, point)]; }

  /// The point between two frames, by linear interpolation. Not seen outside of the frames, and not seen unless both
  /// frames see it; the confidence is the lower of the two. @param frame fractional
  TrackPoint sample(double frame, int point) const;
  /// The frame at a common time in seconds, fractional.
  double frame_at(double seconds) const { return seconds * fps + offset; }
  double seconds_at(double frame) const { return (frame - offset) / fps; }

 private:
  std::size_t index(long frame, int point) const;
  long num_frames_ = 0;
  int num_points_ = 0;
  std::vector<TrackPoint> points_;  ///< [F, K]
};

/// The points of one person in all cameras of a rig. `cameras` has the order of the calibrated cameras which they are
/// used with.
struct PointTracks {
  std::vector<std::string> points;   ///< [K] names
  std::vector<CameraTrack> cameras;  ///< [C]

  int num_points() const { return static_cast<int>(points.size()); }
  int num_cameras() const { return static_cast<int>(cameras.size()); }
  /// Times in seconds at which at least two cameras have a frame: the frames of the camera with the fewest frames per
  /// second that lie within. @param most times; more are thinned out evenly, 0: all
  std::vector<double> times(std::size_t most = 0) const;
};

/// Takes out points whose pixel or confidence is not finite, and those below `min_confidence`.
/// @return the number of points that are left
long drop_unusable(PointTracks& tracks, double min_confidence);

/// Checks that tracks and cameras belong together.
/// @param purpose begins the message: "refining a rig"
/// @throws Error for fewer than `min_cameras`, other names or numbers of points, frame rates that are not positive,
/// faulty cameras, or when no point was seen
void check_tracks(const std::vector<Camera>& cameras, const PointTracks& tracks, int min_cameras,
                  const std::string& purpose);

}  // namespace doppel
