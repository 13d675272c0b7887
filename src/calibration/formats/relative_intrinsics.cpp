#include "doppel/calibration/formats/relative_intrinsics.h"

#include <algorithm>

namespace doppel {
namespace {

constexpr double kMaxRelativeFocalLength = 64.0;
constexpr double kCornerOrCentre = 0.25;  // K(0, 2) is near 0.5 from the corner and near 0 from the centre

}  // namespace

bool has_relative_intrinsics(const Camera& camera) {
  return camera.width == 0 && camera.K(0, 0) < kMaxRelativeFocalLength;
}

Camera with_image_size(Camera camera, int width, int height) {
  if (camera.width > 0) return camera;
  if (has_relative_intrinsics(camera)) {
    const bool from_corner = camera.K(0, 2) > kCornerOrCentre;
    camera.K.topRows<2>() *= from_corner ? width : std::max(width, height);
    if (!from_corner) {
      camera.K(0, 2) += 0.5 * width;
      camera.K(1, 2) += 0.5 * height;
    }
  }
  camera.width = width;
  camera.height = height;
  return camera;
}

}  // namespace doppel
