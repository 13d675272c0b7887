#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "doppel/geometry/camera.h"

namespace doppel {

/// Reads the cameras of a capture, in file order, from any calibration format that Doppel knows. The content decides
/// the format, not the file name:
/// - Skeletool `.calibration` V1.0 (millimetres in the file)   -> calibration_skeletool.cpp
/// - OpenCV FileStorage (.yml/.yaml/.xml/.json; metres unless a node `units` says `millimetres`): one mapping per
///   camera with `width height K dist R t`, and perhaps `name`   -> calibration_opencv.cpp
///   Without `name`, node `cam7` is camera "7". `pixel_centre: 0` puts the first pixel's centre at 0 instead of 0.5.
/// A moving Skeletool camera (`animated 1`) yields one Camera per frame, named `<name>@<frame>`.
/// @throws FileError for an unknown, truncated or impossible file; Camera::faults checks every camera
std::vector<Camera> read_calibration(const std::filesystem::path& path);

/// Writes cameras in the format of the extension: `.calibration` (Skeletool, mm) or `.yml`/`.yaml`/`.json`/`.xml`
/// (OpenCV, metres). Reading the file back gives the same doubles.
/// @throws Error for another extension or for distortion that Skeletool files cannot hold
void write_calibration(const std::filesystem::path& path, const std::vector<Camera>& cameras);

}  // namespace doppel
