#pragma once

#include <string>
#include <vector>

#include "doppel/calibration/estimation/point_tracks.h"
#include "doppel/geometry/camera.h"

namespace doppel {

/// A camera that was pushed during the recording.
struct MovedCamera {
  int camera = 0;
  std::string name;
  double seconds = 0.0;      ///< common time of the move
  double frame = 0.0;        ///< of this camera
  double frame_sigma = 0.0;  ///< frames
  double jump = 0.0;         ///< by how many pixels the image of the person jumped, median
  double rotation = 0.0;     ///< radians between the poses before and after
  double shift = 0.0;        ///< metres between the centres
  Camera before, after;      ///< refitted to the points that the other cameras give
};

/// Names the cameras that moved during a recording. Points in space come from the other cameras. A camera has moved
/// when its residuals have a change-point, and one pose before and one pose after explain its points with less than
/// half of the robust cost of one pose for all. The jump is at least 1.5 pixels of an image 1024 wide, and at least 8 %
/// of the recording lie on each side of it. Cameras are judged one after the other, the clearest first; a moved camera
/// takes no further part.
/// @return the moved cameras by time; empty when none moved
/// @throws Error as check_tracks, for fewer than three cameras: with two, nobody can say which one moved
std::vector<MovedCamera> find_moved_cameras(const std::vector<Camera>& cameras, const PointTracks& tracks);

}  // namespace doppel
