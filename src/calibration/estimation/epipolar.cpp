#include "doppel/calibration/estimation/epipolar.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "doppel/calibration/estimation/camera_jacobian.h"
#include "doppel/core/as_size.h"
#include "doppel/core/statistics.h"

namespace doppel {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

constexpr int kAllPairsUpTo = 9;      // cameras
constexpr std::size_t kPartners = 6;  // of each camera, if there are more
constexpr double kBestAngle = 1.2;    // radians between the viewing directions of partners

}  // namespace

EpipolarPair::EpipolarPair(const Camera& a, const Camera& b) {
  const Matrix3d b_from_a = b.R * a.R.transpose();
  const Vector3d t = b.t - b_from_a * a.t;
  fundamental_ = b.K.inverse().transpose() * cross_matrix(t) * b_from_a * a.K.inverse();
  if (fundamental_.norm() > 0.0) fundamental_.normalize();
}

double EpipolarPair::distance(const Vector2d& a, const Vector2d& b) const {
  const Vector3d line_in_b = fundamental_ * a.homogeneous(), line_in_a = fundamental_.transpose() * b.homogeneous();
  const double slope = std::sqrt(line_in_b.head<2>().squaredNorm() + line_in_a.head<2>().squaredNorm());
  if (!(slope > 0.0)) return std::numeric_limits<double>::infinity();
  return b.homogeneous().dot(line_in_b) / slope;
}

std::optional<Vector2d> straight_pixel(const Camera& camera, const Vector2d& pixel) {
  if (!pixel.allFinite()) return std::nullopt;
  const Eigen::Matrix2d scale = camera.K.topLeftCorner<2, 2>();
  const Vector2d centre = camera.K.topRightCorner<2, 1>();
  const auto plane = camera.undistorted(scale.inverse() * (pixel - centre));
  if (!plane || !plane->allFinite()) return std::nullopt;
  return Vector2d(scale * *plane + centre);
}

Vector2d filmed_pixel(const Camera& camera, const Vector2d& straight) {
  if (!camera.has_distortion()) return straight;
  const Eigen::Matrix2d scale = camera.K.topLeftCorner<2, 2>();
  const Vector2d centre = camera.K.topRightCorner<2, 1>();
  return scale * camera.distorted(scale.inverse() * (straight - centre)) + centre;
}

PointTracks straight_tracks(const std::vector<Camera>& cameras, const PointTracks& tracks) {
  PointTracks straight = tracks;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    CameraTrack& track = straight.cameras[c];
    for (long frame = 0; frame < track.num_frames(); ++frame)
      for (int k = 0; k < track.num_points(); ++k) {
        TrackPoint& point = track.at(frame, k);
        if (!point.seen()) continue;
        const auto pixel = straight_pixel(cameras[c], point.pixel);
        point = pixel ? TrackPoint{*pixel, point.confidence} : TrackPoint{};
      }
  }
  return straight;
}

std::vector<std::pair<int, int>> pairs_to_compare(const std::vector<Camera>& cameras) {
  std::vector<std::pair<int, int>> pairs;
  for (std::size_t a = 0; a < cameras.size(); ++a) {
    std::vector<std::pair<double, std::size_t>> partners;
    for (std::size_t b = 0; b < cameras.size(); ++b) {
      const double baseline = (cameras[a].centre() - cameras[b].centre()).norm();
      if (a == b || !(baseline > 1e-6)) continue;  // cameras in one position have no epipolar lines
      const double cosine = cameras[a].R.row(2).dot(cameras[b].R.row(2));
      partners.emplace_back(std::abs(std::acos(std::clamp(cosine, -1.0, 1.0)) - kBestAngle), b);
    }
    std::sort(partners.begin(), partners.end());
    if (cameras.size() > as_size(kAllPairsUpTo) && partners.size() > kPartners) partners.resize(kPartners);
    for (const auto& [difference, b] : partners)
      pairs.emplace_back(static_cast<int>(std::min(a, b)), static_cast<int>(std::max(a, b)));
  }
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  return pairs;
}

std::vector<EpipolarAgreement> epipolar_agreement(const std::vector<Camera>& cameras, const PointTracks& tracks,
                                                  const std::vector<double>& times) {
  check_tracks(cameras, tracks, 2, "comparing pairs of cameras");
  const PointTracks straight = straight_tracks(cameras, tracks);
  std::vector<EpipolarAgreement> all;
  for (int a = 0; a < tracks.num_cameras(); ++a)
    for (int b = a + 1; b < tracks.num_cameras(); ++b) {
      const EpipolarPair pair(cameras[a], cameras[b]);
      const CameraTrack &in_a = straight.cameras[a], &in_b = straight.cameras[b];
      std::vector<double> distances;
      for (const double time : times)
        for (int k = 0; k < tracks.num_points(); ++k) {
          const TrackPoint p = in_a.sample(in_a.frame_at(time), k), q = in_b.sample(in_b.frame_at(time), k);
          if (!p.seen() || !q.seen()) continue;
          const double distance = std::abs(pair.distance(p.pixel, q.pixel));
          if (std::isfinite(distance)) distances.push_back(distance);
        }
      const auto samples = static_cast<long>(distances.size());
      all.push_back({a, b, samples, quantile(distances, 0.5)});
    }
  return all;
}

}  // namespace doppel
