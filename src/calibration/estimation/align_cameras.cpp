#include "doppel/calibration/estimation/align_cameras.h"

#include <cmath>

#include "doppel/core/error.h"
#include "doppel/geometry/best_rotation.h"

namespace doppel {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Similarity align_cameras(const std::vector<Camera>& from, const std::vector<Camera>& to) {
  if (from.size() != to.size() || from.empty())
    fail("aligning cameras: {} cameras and {} cameras were given; the same number, at least one, is needed",
         from.size(), to.size());
  const auto count = static_cast<double>(from.size());
  Vector3d middle_from = Vector3d::Zero(), middle_to = Vector3d::Zero();
  for (std::size_t c = 0; c < from.size(); ++c) {
    middle_from += from[c].centre() / count;
    middle_to += to[c].centre() / count;
  }
  Matrix3d centres = Matrix3d::Zero(), axes = Matrix3d::Zero();
  double spread_from = 0.0, spread_to = 0.0;
  for (std::size_t c = 0; c < from.size(); ++c) {
    const Vector3d a = from[c].centre() - middle_from, b = to[c].centre() - middle_to;
    centres += b * a.transpose();
    axes += to[c].R.transpose() * from[c].R;
    spread_from += a.squaredNorm();
    spread_to += b.squaredNorm();
  }
  const bool spread = spread_from > 1e-12 * count && spread_to > 1e-12 * count;
  // The turn with the largest trace of its product with the sum (Procrustes); lengths in units of the spreads.
  Matrix3d sum = axes / count;
  if (spread) sum += centres / std::sqrt(spread_from * spread_to);
  Similarity world;
  world.rotation = nearest_rotation(sum);
  if (spread) world.scale = (world.rotation.transpose() * centres).trace() / spread_from;
  if (!(world.scale > 0.0)) world.scale = 1.0;
  world.shift = middle_to - world.scale * world.rotation * middle_from;
  return world;
}

Camera transformed(const Camera& camera, const Similarity& world) {
  Camera result = camera;
  result.R = camera.R * world.rotation.transpose();
  result.t = -result.R * (world.scale * world.rotation * camera.centre() + world.shift);
  return result;
}

}  // namespace doppel
