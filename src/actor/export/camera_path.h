#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "doppel/character/character.h"
#include "doppel/geometry/camera.h"

namespace doppel {

/// A camera for every frame of a film.
class CameraPath {
 public:
  virtual ~CameraPath() = default;
  /// @param frame 0, 1, 2, ... in order
  /// @param vertices [N,3] world metres, the surface of that frame
  /// @return a camera of the same size in every frame
  virtual PinholeCamera at(int frame, std::span<const float> vertices) = 0;
  /// A name for file names: `turntable`, `camera_3`.
  virtual std::string name() const = 0;
  virtual int width() const = 0;
  virtual int height() const = 0;
};

struct OrbitOptions {
  int size = 512;  ///< pixels, square
  double frames_per_second = 25.0;
  double turns_per_second = 0.1;  ///< 0: a static camera in front
};
/// A camera that circles the actor at the height of its centre and follows it.
std::unique_ptr<CameraPath> make_orbit(const Character& character, const OrbitOptions& options);

/// A camera of a calibration, or the frames of a moving camera (`NAME@0`, `NAME@1`, ...; the last one is repeated).
/// @param size the longer side of the image in pixels; 0: as calibrated. Sides are rounded to even numbers, as video
/// encoders require.
/// @param step frames of a moving camera from one frame of the film to the next; the nearest one is taken
/// @throws UsageError listing the cameras when `name` is not one of them
std::unique_ptr<CameraPath> make_calibrated_path(const std::vector<Camera>& cameras, const std::string& name, int size,
                                                 double step = 1.0);

}  // namespace doppel
