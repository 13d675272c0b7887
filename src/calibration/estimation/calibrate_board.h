#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "doppel/calibration/estimation/board.h"
#include "doppel/geometry/camera.h"

namespace doppel {

/// The boards that one camera saw.
struct BoardSightings {
  std::string camera;
  int width = 0, height = 0;        ///< of the images
  std::map<long, BoardView> views;  ///< by instant; cameras that film one instant use the same number
};

struct BoardCalibrationOptions {
  Lens lens = Lens::opencv;     ///< opencv or fisheye
  std::size_t most_views = 60;  ///< views per camera; more are thinned out, those that differ most are kept
  std::size_t fewest_views = 3;
  std::optional<long> floor;  ///< instant at which the board lies on the floor: its plane is y = 0
};

struct CameraIntrinsics {
  Camera camera;             ///< intrinsics and lens; the pose is the identity
  double rms = 0.0;          ///< root mean square distance of the corners, pixels
  double focal_sigma = 0.0;  ///< standard deviation, pixels
  std::size_t views = 0;
  std::vector<std::string> notes;  ///< plain sentences: where the lens is uncertain, and what may be wrong
};

/// Intrinsics and lens of one camera by OpenCV's calibrateCamera (or fisheye::calibrate). Views that are far worse than
/// the others are left out. Coefficients of distortion that the corners do not determine stay 0: k3 of a lens opencv;
/// k3 and k4 of a fisheye lens, unless corners lie beyond 45 and 60 degrees from the axis.
/// @throws Error for too few views, or boards that all face the camera in the same way
CameraIntrinsics calibrate_intrinsics(const BoardSightings& sightings, const Board& board,
                                      const BoardCalibrationOptions& options = {});

struct BoardCamera {
  CameraIntrinsics intrinsics;
  bool posed = false;      ///< whether boards connect the camera with the first one
  std::size_t boards = 0;  ///< images in which the board was found
  std::size_t shared = 0;  ///< instants at which another camera saw the board as well
  double rms = 0.0;        ///< after the adjustment of all cameras, pixels
};

struct BoardCalibration {
  std::vector<BoardCamera> cameras;  ///< in the order of the sightings, without those that could not be calibrated
  double rms = 0.0;                  ///< of all corners, pixels; 0 when no camera is posed
  std::vector<std::string> notes;
};

/// Intrinsics of every camera, and the poses of those that saw the board at the same instants: relative poses along the
/// graph of pairs, the pairs with the most shared views first, then bundle adjustment of cameras and boards. In the
/// world, y is up: the normal of the board on the floor, or the mean direction that is up in the images. y = 0 is the
/// board on the floor, or the lowest corner of all boards. Cameras whose views are too few or too much alike are left
/// out with a note; so are the poses of cameras that no board connects with the others.
/// @throws Error as calibrate_intrinsics, naming the cameras, when none can be calibrated; UsageError when no posed
/// camera sees the board on the floor
BoardCalibration calibrate_boards(const std::vector<BoardSightings>& sightings, const Board& board,
                                  const BoardCalibrationOptions& options = {});

}  // namespace doppel
