#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "doppel/data/capture.h"
#include "doppel/geometry/camera.h"

namespace doppel {

/// The cameras that a capture uses.
struct CaptureCameras {
  std::vector<Camera> cameras;  ///< [C] as calibrated, with distortion
  std::vector<int> file_index;  ///< [C] position in the calibration file
};

/// Those the capture names, in its order, or all of the calibration file.
/// @throws Error naming a camera that the calibration file does not have; FileError as read_calibration
CaptureCameras choose_cameras(const Capture& capture);

/// The camera at the resolution of its pictures, and a line in the log where that differs from the calibration's.
/// @param source where the pictures are, for messages @throws Error when the aspect ratios differ by more than 1 %
Camera fit_to_pictures(const Camera& camera, cv::Size pictures, const std::string& source);

}  // namespace doppel
