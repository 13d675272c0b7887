#pragma once

#include <Eigen/Core>

#include "doppel/geometry/camera.h"

namespace doppel {

/// d distorted / d plane, by central differences of Camera::distorted; the identity without distortion.
/// @param plane x/z, y/z of a point in camera axes
Eigen::Matrix2d lens_jacobian(const Camera& camera, const Eigen::Vector2d& plane);

}  // namespace doppel
