#pragma once

#include <Eigen/Core>
#include <vector>

#include "doppel/geometry/camera.h"

namespace doppel {

/// A known point in space and where a camera saw it.
struct PointSighting {
  Eigen::Vector3d point;  ///< world, metres
  Eigen::Vector2d pixel;  ///< as filmed
};

/// The camera moved and turned such that known points project to where it saw them: robust least squares from the given
/// pose (Geman-McClure). @param kernel pixels of an image 1024 wide
Camera fit_pose(const Camera& camera, const std::vector<PointSighting>& points, double kernel);

/// The robust cost of a pose, squared pixels of an image 1024 wide; points behind the camera count as outliers.
double pose_cost(const Camera& camera, const std::vector<PointSighting>& points, double kernel);

/// The median distance, in pixels of an image 1024 wide; 0 without points.
double median_residual(const Camera& camera, const std::vector<PointSighting>& points);

}  // namespace doppel
