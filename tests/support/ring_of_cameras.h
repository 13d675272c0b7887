#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <string>
#include <vector>

#include "doppel/geometry/camera.h"

namespace doppel {

/// Cameras `c0`, `c1`, ... evenly around `target`, 3 m away and looking at it. @param size pixels of the square
/// images
inline std::vector<PinholeCamera> ring_of_cameras(int count, int size, const Eigen::Vector3d& target) {
  std::vector<PinholeCamera> cameras;
  for (int i = 0; i < count; ++i) {
    const double angle = 2.0 * M_PI * i / count + 0.3;
    PinholeCamera camera;
    camera.name = "c" + std::to_string(i);
    camera.width = camera.height = size;
    camera.K << 1.3 * size, 0, 0.5 * size, 0, 1.3 * size, 0.5 * size, 0, 0, 1;
    const Eigen::Vector3d centre = target + 3.0 * Eigen::Vector3d(std::sin(angle), 0.1, std::cos(angle));
    const Eigen::Vector3d z = (target - centre).normalized(), x = Eigen::Vector3d(0, -1, 0).cross(z).normalized();
    camera.R.row(0) = x;
    camera.R.row(1) = z.cross(x);
    camera.R.row(2) = z;
    camera.t = -camera.R * centre;
    cameras.push_back(camera);
  }
  return cameras;
}

}  // namespace doppel
