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

/// The cameras that the capture names, in its order; all cameras of the calibration file when it names none.
/// @throws Error naming a camera that the calibration file does not have; FileError as read_calibration
CaptureCameras choose_cameras(const Capture& capture);

/// The camera scaled to the resolution of its images. Logs a line when this resolution differs from the calibration.
/// @param source path of the images, for messages
/// @throws Error when the aspect ratios differ by more than 1 %
Camera fit_to_images(const Camera& camera, cv::Size images, const std::string& source);

}  // namespace doppel
