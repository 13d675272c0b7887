#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "doppel/geometry/camera.h"

namespace doppel {

/// One file format. A new format is one file that implements this class, and one line in calibration.cpp.
class CalibrationFormat {
 public:
  virtual ~CalibrationFormat() = default;
  virtual std::string name() const = 0;
  /// Whether `head` (the first 4 kB of a file) has this format.
  virtual bool recognises(const std::string& head) const = 0;
  virtual bool writes(const std::string& extension) const = 0;
  virtual std::vector<Camera> read(const std::filesystem::path& path) const = 0;
  virtual void write(const std::filesystem::path& path, const std::vector<Camera>& cameras) const = 0;
};

/// Skeletool `.calibration` V1.0 (calibration_skeletool.cpp).
std::unique_ptr<CalibrationFormat> make_skeletool_calibration();
/// OpenCV FileStorage (calibration_opencv.cpp).
std::unique_ptr<CalibrationFormat> make_opencv_calibration();

}  // namespace doppel
