#include "doppel/geometry/image_box.h"

#include <limits>

namespace doppel {

cv::Rect image_box(const std::vector<Eigen::Vector3d>& points, const PinholeCamera& camera, int margin) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Eigen::Vector2d low(kInfinity, kInfinity), high = -low;
  for (const Eigen::Vector3d& point : points) {
    if (camera.camera_from_world(point).z() <= 0.0) continue;
    const Eigen::Vector2d pixel = camera.project(point);
    low = low.cwiseMin(pixel);
    high = high.cwiseMax(pixel);
  }
  const Eigen::Vector2d size(camera.width, camera.height);
  if ((high.array() <= low.array().max(0.0)).any() || (low.array() >= size.array()).any()) return {};
  const Eigen::Vector2d first = (low.array() - margin).max(0.0).floor(),
                        last = (high.array() + margin).min(size.array()).ceil();
  return {static_cast<int>(first.x()), static_cast<int>(first.y()), static_cast<int>(last.x() - first.x()),
          static_cast<int>(last.y() - first.y())};
}

}  // namespace doppel
