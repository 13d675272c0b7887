#include "doppel/calibration/formats/rig_parts.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "doppel/core/statistics.h"
#include "doppel/geometry/decompositions.h"

namespace doppel {
namespace {

constexpr double kParallel = 1e-6;      // smallest eigenvalue of the mean projection that fixes a point
constexpr double kSpreadOfView = 0.3;   // largest distance to the axes, in depths
constexpr double kFarFromOrigin = 1e5;  // metres

Eigen::Vector3d rig_mean_centre(const std::vector<Camera>& cameras) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Camera& camera : cameras) mean += camera.centre() / static_cast<double>(cameras.size());
  return mean;
}

/// The projection along the optical axis of a camera.
Eigen::Matrix3d rig_across_axis(const Camera& camera) {
  const Eigen::Vector3d axis = camera.R.row(2).transpose();
  return Eigen::Matrix3d::Identity() - axis * axis.transpose();
}

}  // namespace

bool CommonView::holds() const {
  return behind == 0 && median_depth > 0.0 && median_distance <= kSpreadOfView * median_depth;
}

std::optional<CommonView> common_view(const std::vector<Camera>& cameras) {
  if (cameras.size() < 2) return std::nullopt;
  const Eigen::Vector3d mean = rig_mean_centre(cameras);  // as origin, for the sake of the digits
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  Eigen::Vector3d weighted = Eigen::Vector3d::Zero();
  for (const Camera& camera : cameras) {
    const Eigen::Matrix3d across = rig_across_axis(camera) / static_cast<double>(cameras.size());
    sum += across;
    weighted += across * (camera.centre() - mean);
  }
  if (!sum.allFinite() || !weighted.allFinite()) return std::nullopt;
  const auto [values, vectors] = symmetric_eigen(sum);
  if (!(values[0] > kParallel)) return std::nullopt;
  CommonView view;
  view.point = mean + vectors * (values.cwiseInverse().asDiagonal() * (vectors.transpose() * weighted));
  std::vector<double> distances, depths;
  for (const Camera& camera : cameras) {
    const Eigen::Vector3d to_point = view.point - camera.centre();
    distances.push_back((rig_across_axis(camera) * to_point).norm());
    depths.push_back(camera.R.row(2).dot(to_point));
    view.behind += depths.back() <= 0.0 ? 1 : 0;
  }
  view.median_distance = median(std::move(distances));
  view.median_depth = median(std::move(depths));
  return view;
}

bool look_at_one_point(const std::vector<Camera>& cameras) {
  const auto view = common_view(cameras);
  return view && view->holds();
}

void recentre_if_far(Calibration& calibration) {
  double farthest = 0.0;
  for (const Camera& camera : calibration.cameras) farthest = std::max(farthest, camera.centre().cwiseAbs().maxCoeff());
  if (!(farthest > kFarFromOrigin) || !std::isfinite(farthest)) return;
  const Eigen::Vector3d origin = rig_mean_centre(calibration.cameras).array().round();
  for (Camera& camera : calibration.cameras) camera.t += camera.R * origin;
  calibration.notes.emplace_back(
      fmt::format("the coordinates of the file are large, as on a map: the origin was moved to "
                  "({:.0f}, {:.0f}, {:.0f}) of the file's world",
                  origin.x(), origin.y(), origin.z()));
}

}  // namespace doppel
