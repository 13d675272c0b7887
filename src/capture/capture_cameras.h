#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "doppel/capture/capture.h"
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

/// The camera at the resolution of its images, and a line in the log where that differs from the calibration's.
/// @param source where the images are, for messages @throws Error when the aspect ratios differ by more than 1 %
Camera fit_to_images(const Camera& camera, cv::Size images, const std::string& source);

}  // namespace doppel
