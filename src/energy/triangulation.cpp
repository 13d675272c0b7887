#include "doppel/energy/triangulation.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <limits>

#include "doppel/core/as_size.h"

namespace doppel {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

struct Ray {
  const PinholeCamera* camera;
  Vector3d origin, direction;
  Vector2d pixel;
  double weight;
};

std::vector<Ray> rays_to(const std::vector<PinholeCamera>& cameras, const FrameEvidence& frame, int landmark) {
  std::vector<Ray> rays;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const Keypoint& seen = frame[c].keypoints[as_size(landmark)];
    if (!(seen.confidence >= kSeenConfidence)) continue;
    const Vector3d in_camera = cameras[c].K.inverse() * Vector3d(seen.x, seen.y, 1.0);
    rays.push_back({&cameras[c],
                    cameras[c].centre(),
                    (cameras[c].R.transpose() * in_camera).normalized(),
                    {seen.x, seen.y},
                    seen.confidence});
  }
  return rays;
}

/// The point nearest to weighted rays.
Vector3d nearest_point(const std::vector<const Ray*>& rays) {
  Matrix3d sum = Matrix3d::Zero();
  Vector3d right = Vector3d::Zero();
  for (const Ray* ray : rays) {
    const Matrix3d across = ray->weight * (Matrix3d::Identity() - ray->direction * ray->direction.transpose());
    sum += across;
    right += across * ray->origin;
  }
  return sum.inverse() * right;
}

/// Distance of the point's projection from the keypoint, reference pixels.
double distance_in_view(const Ray& ray, const Vector3d& point) {
  const auto projected = project_with_jacobian(*ray.camera, point);
  if (!projected) return std::numeric_limits<double>::infinity();
  return reference_pixels(*ray.camera) * (projected->pixel - ray.pixel).norm();
}

struct Inliers {
  std::vector<const Ray*> rays;
  double squares = 0.0;
  bool better_than(const Inliers& other) const {
    return rays.size() > other.rays.size() || (rays.size() == other.rays.size() && squares < other.squares);
  }
};

Inliers inliers_of(const std::vector<Ray>& rays, const Vector3d& point, double within) {
  Inliers result;
  for (const Ray& ray : rays) {
    const double distance = distance_in_view(ray, point);
    if (!(distance <= within)) continue;
    result.rays.push_back(&ray);
    result.squares += distance * distance;
  }
  return result;
}

}  // namespace

std::optional<TriangulatedPoint> triangulate(const std::vector<PinholeCamera>& cameras, const FrameEvidence& frame,
                                             int landmark, const TriangulationOptions& options) {
  const std::vector<Ray> rays = rays_to(cameras, frame, landmark);
  Inliers best;
  for (std::size_t i = 0; i < rays.size(); ++i)
    for (std::size_t j = i + 1; j < rays.size(); ++j) {
      if (rays[i].direction.cross(rays[j].direction).norm() < std::sin(options.smallest_angle)) continue;
      Inliers found = inliers_of(rays, nearest_point({&rays[i], &rays[j]}), options.inlier_threshold);
      if (found.rays.size() >= 2 && found.better_than(best)) best = std::move(found);
    }
  if (best.rays.size() < 2) return std::nullopt;
  TriangulatedPoint point;
  point.position = nearest_point(best.rays);
  const Inliers all = inliers_of(rays, point.position, options.inlier_threshold);
  if (all.rays.size() < 2) return std::nullopt;
  point.views = static_cast<int>(all.rays.size());
  point.error = std::sqrt(all.squares / point.views);
  return point;
}

std::vector<std::optional<TriangulatedPoint>> triangulate_all(const std::vector<PinholeCamera>& cameras,
                                                              const FrameEvidence& frame, int num_landmarks,
                                                              const TriangulationOptions& options) {
  std::vector<std::optional<TriangulatedPoint>> points;
  points.reserve(as_size(num_landmarks));
  for (int m = 0; m < num_landmarks; ++m) points.push_back(triangulate(cameras, frame, m, options));
  return points;
}

}  // namespace doppel
