#pragma once

#include <string>
#include <vector>

#include "doppel/geometry/camera.h"

namespace doppel {

/// What a calibration says, in the program's world: metres, right-handed, y up, the first pixel's centre at (0.5, 0.5).
struct Calibration {
  std::string format;     ///< name of the format, for instance "colmap"
  std::string unit;       ///< of the lengths in the file: "m", "cm", "mm"; stated, given or assumed
  std::string up;         ///< axis of the file's world that points up: "+x" ... "-z", or "unknown" (axes were kept)
  bool has_poses = true;  ///< false: the file has only intrinsics
  bool has_scale = true;  ///< false: lengths have an arbitrary scale (structure from motion)
  std::vector<Camera> cameras;     ///< in file order; width and height are 0 if the file does not state them
  std::vector<std::string> notes;  ///< plain sentences: what was left out, what was guessed and why
};

/// What the user knows better than the file, which it overrides. Empty: as the file says, or as it can be found out.
struct CalibrationOptions {
  std::string unit;  ///< "m", "cm" or "mm"
  std::string up;    ///< "+x" ... "-z"
  /// Which subject's cameras, where a file holds those of several (Human3.6M), for instance "S9". Empty: that of the
  /// folder of this name in which the file lies.
  std::string subject{};
};

}  // namespace doppel
