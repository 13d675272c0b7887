#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "doppel/geometry/camera.h"

namespace doppel {

/// Cameras from above (left: x to the right, z down) and from the side (right: x to the right, y up), each with its
/// name and view direction, on a grid of one metre (of 0.1 or 10 m for other extents).
/// @return CV_8UC3
cv::Mat draw_camera_plan(const std::vector<Camera>& cameras);

}  // namespace doppel
