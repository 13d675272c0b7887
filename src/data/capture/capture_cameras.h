#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "doppel/data/capture/capture.h"
#include "doppel/geometry/camera.h"

namespace doppel {

/// The cameras that a capture uses.
struct CaptureCameras {
  std::vector<Camera> cameras;  ///< [C] as calibrated, with distortion
  std::vector<int> file_index;  ///< [C] position in the calibration
};

/// The largest difference of the aspect ratios of calibration and images that is put down to a rounded size.
inline constexpr double kMaxStretch = 0.01;

/// All cameras of the capture's calibration. Their width and height are 0 if the calibration does not state them.
/// @throws FileError as load_calibration, and when the calibration has no poses
std::vector<Camera> calibrated_cameras(const Capture& capture);

/// The cameras that the capture names, in its order; all cameras of the calibration when it names none.
/// @throws Error naming a camera that the calibration does not have, also as a key of `videos`, `frame_offset` and
/// such; FileError as calibrated_cameras
CaptureCameras choose_cameras(const Capture& capture);

/// Whether the images are those of the calibration without the padding of a video encoder: one side is equal, the other
/// is a multiple of 16 in the calibration and less than 16 pixels shorter in the images (1088 and 1080).
bool is_without_padding(const Camera& camera, cv::Size images);

/// The camera for its images. Without padding (`is_without_padding`) pixels keep their positions, because encoders pad
/// on the right and below. Otherwise the camera is scaled to the resolution of the images, or gets that resolution if
/// it has none. Logs a line when this resolution differs from the calibration, as a warning when the aspect ratio
/// differs too.
/// @param source path of the images, for messages
/// @throws Error when the aspect ratios differ by more than kMaxStretch
Camera fit_to_images(const Camera& camera, cv::Size images, const std::string& source);

}  // namespace doppel
