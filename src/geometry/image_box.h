#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

#include "doppel/geometry/camera.h"

namespace doppel {

/// The part of a camera's image that the projected points lie in; points behind the camera do not count.
/// @param points world metres @param margin pixels around the points
/// @return within the image; empty when the box of the points lies beside it
cv::Rect image_box(const std::vector<Eigen::Vector3d>& points, const PinholeCamera& camera, int margin);

}  // namespace doppel
