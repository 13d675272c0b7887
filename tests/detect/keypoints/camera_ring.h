#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <string>
#include <vector>

#include "doppel/geometry/camera.h"

namespace doppel::test_keypoints {

/// Cameras `c0`, `c1`, ... of 1200 x 1000 pixels with lens distortion, on a ring of 4 m around (0, 1, 0), which they
/// look at.
inline std::vector<Camera> camera_ring(int count) {
  using Eigen::Vector3d;
  std::vector<Camera> cameras;
  for (int i = 0; i < count; ++i) {
    const double angle = 2 * M_PI * i / count + 0.2;
    Camera camera;
    camera.name = "c" + std::to_string(i);
    camera.width = 1200;
    camera.height = 1000;
    camera.K << 900, 0, 600, 0, 900, 500, 0, 0, 1;
    camera.distortion = {-0.1, 0.02};
    const Vector3d target(0, 1, 0), centre(4 * std::sin(angle), 1.2 + 0.4 * (i % 2), 4 * std::cos(angle));
    const Vector3d z = (target - centre).normalized(), x = Vector3d(0, -1, 0).cross(z).normalized();
    camera.R.row(0) = x;
    camera.R.row(1) = z.cross(x);
    camera.R.row(2) = z;
    camera.t = -camera.R * centre;
    cameras.push_back(camera);
  }
  return cameras;
}

}  // namespace doppel::test_keypoints
