#pragma once

#include <memory>

#include "doppel/geometry/calibration.h"

namespace doppel {

/// Skeletool `.calibration` V1.0 (calibration_skeletool.cpp).
std::unique_ptr<CalibrationFormat> make_skeletool_calibration();
/// OpenCV FileStorage (calibration_opencv.cpp).
std::unique_ptr<CalibrationFormat> make_opencv_calibration();

}  // namespace doppel
