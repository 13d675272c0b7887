#pragma once

#include <map>
#include <string>
#include <vector>

#include "doppel/data/capture/camera_paths.h"

namespace doppel {

/// One path with `{name}` or `{camera}` for the files of all cameras, where one fits; else the path of each camera. The
/// files of a single camera are named without placeholder, except for `{frame}`.
/// @param by_camera index of the camera in the calibration -> path, which may hold `{frame}`; not empty
/// @param names of all cameras of the calibration
CameraPaths paths_of_cameras(const std::map<int, std::string>& by_camera, const std::vector<std::string>& names);

}  // namespace doppel
