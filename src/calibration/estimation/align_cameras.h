#pragma once

#include <Eigen/Core>
#include <vector>

#include "doppel/geometry/camera.h"

namespace doppel {

/// The similarity x -> scale * rotation * x + shift of a world.
struct Similarity {
  double scale = 1.0;
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
};
/// The similarity that brings cameras closest to others: centres by least squares, and viewing directions, which count
/// as much as the spread of the centres. Two cameras, and cameras on a line, are aligned too.
Similarity align_cameras(const std::vector<Camera>& from, const std::vector<Camera>& to);
/// The camera in the moved world.
Camera transformed(const Camera& camera, const Similarity& world);

}  // namespace doppel
