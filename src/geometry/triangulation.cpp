#include "doppel/geometry/triangulation.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <limits>

#include "doppel/geometry/lens_jacobian.h"

namespace doppel {
namespace {

using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kNearestPointDepth = 0.05;  // metres
constexpr double kMinReciprocal = 1e-12;

/// A matrix that measures how close three equations are to a dependent set: parallel rays fix no point.
bool is_regular(const Matrix3d& sum) {
  return sum.allFinite() && std::abs(sum.determinant()) > kMinReciprocal * std::pow(sum.trace(), 3);
}

using Chosen = std::vector<const Sight*>;

/// The point nearest to weighted rays.
std::optional<Vector3d> nearest_point(const Chosen& sights) {
  Matrix3d sum = Matrix3d::Zero();
  Vector3d right = Vector3d::Zero();
  for (const Sight* sight : sights) {
    const Matrix3d across = sight->weight * (Matrix3d::Identity() - sight->direction * sight->direction.transpose());
    sum += across;
    right += across * sight->centre;
  }
  if (!is_regular(sum)) return std::nullopt;
  return Vector3d(sum.inverse() * right);
}

struct Inliers {
  Chosen sights;
  double squares = 0.0;
  std::optional<double> cost;            ///< of all sights under a kernel
  Vector3d proposed = Vector3d::Zero();  ///< the point with which they agree
  bool better_than(const Inliers& other) const {
    if (cost && other.cost) return *cost < *other.cost;
    return sights.size() > other.sights.size() || (sights.size() == other.sights.size() && squares < other.squares);
  }
};

double distance_in_view(const Sight& sight, const Vector3d& point) {
  const auto residual = residual_of(sight, point);
  return residual ? residual->norm() : std::numeric_limits<double>::infinity();
}

/// s / (1 + s / kernel^2), Geman-McClure. @param kernel infinite: s itself
double under_kernel(double distance, double kernel) {
  return std::isfinite(distance) ? distance * distance / (1.0 + std::pow(distance / kernel, 2)) : kernel * kernel;
}

/// Weighted squared residuals under a kernel. Without a kernel infinite when the point lies behind a camera.
double cost_of(const Chosen& sights, const Vector3d& point, double kernel) {
  double cost = 0.0;
  for (const Sight* sight : sights) cost += sight->weight * under_kernel(distance_in_view(*sight, point), kernel);
  return cost;
}

Inliers inliers_of(std::span<const Sight> sights, const Vector3d& point, const TriangulationOptions& options) {
  Inliers result;
  result.proposed = point;
  if (options.kernel > 0.0) result.cost = 0.0;
  for (const Sight& sight : sights) {
    const double distance = distance_in_view(sight, point);
    if (result.cost) *result.cost += sight.weight * under_kernel(distance, options.kernel);
    if (!(distance <= options.inlier_threshold)) continue;
    result.sights.push_back(&sight);
    result.squares += distance * distance;
  }
  return result;
}

/// One Gauss-Newton step, taken if it lowers the cost.
bool refine(const Chosen& sights, double kernel, Vector3d& point, double& cost) {
  Matrix3d hessian = Matrix3d::Zero();
  Vector3d gradient = Vector3d::Zero();
  for (const Sight* sight : sights) {
    const Vector3d p = sight->R * point + sight->t;
    Eigen::Matrix<double, 2, 3> projection;
    projection << 1.0 / p.z(), 0.0, -p.x() / (p.z() * p.z()), 0.0, 1.0 / p.z(), -p.y() / (p.z() * p.z());
    const Eigen::Matrix<double, 2, 3> jacobian = sight->unit_from_plane * projection * sight->R;
    const Vector2d residual = sight->unit_from_plane * (p.hnormalized() - sight->plane);
    const double weight = sight->weight / std::pow(1.0 + residual.squaredNorm() / (kernel * kernel), 2);
    hessian += weight * jacobian.transpose() * jacobian;
    gradient += weight * jacobian.transpose() * residual;
  }
  if (!is_regular(hessian)) return false;
  const Vector3d moved = point - hessian.inverse() * gradient;
  const double after = cost_of(sights, moved, kernel);
  if (!(after < cost)) return false;
  point = moved;
  cost = after;
  return true;
}

/// The sights that agree with the best of the points that pairs of rays propose.
Inliers best_of_pairs(std::span<const Sight> sights, const TriangulationOptions& options) {
  const int pairs = static_cast<int>(sights.size() * (sights.size() - 1) / 2);
  const int stride = options.most_pairs > 0 ? (pairs + options.most_pairs - 1) / options.most_pairs : 1;
  Inliers best;
  int pair = 0;
  for (std::size_t i = 0; i < sights.size(); ++i)
    for (std::size_t j = i + 1; j < sights.size(); ++j) {
      if (pair++ % stride != 0) continue;
      const auto point = meeting_point(sights[i], sights[j], options.smallest_angle);
      if (!point) continue;
      Inliers found = inliers_of(sights, *point, options);
      if (found.sights.size() >= 2 && found.better_than(best)) best = std::move(found);
    }
  return best;
}

}  // namespace

std::optional<Sight> sight_of(const Camera& camera, const Vector2d& pixel, double weight) {
  if (!pixel.allFinite()) return std::nullopt;
  const Matrix2d pixel_from_distorted = camera.K.topLeftCorner<2, 2>();
  const auto plane = camera.undistorted(pixel_from_distorted.inverse() * (pixel - camera.K.topRightCorner<2, 1>()));
  if (!plane || !plane->allFinite()) return std::nullopt;
  Sight sight;
  sight.R = camera.R;
  sight.t = camera.t;
  sight.centre = camera.centre();
  sight.direction = (camera.R.transpose() * plane->homogeneous()).normalized();
  sight.plane = *plane;
  sight.unit_from_plane = pixel_from_distorted * lens_jacobian(camera, *plane);
  sight.weight = weight;
  return sight;
}

std::optional<Vector2d> residual_of(const Sight& sight, const Vector3d& point) {
  const Vector3d in_camera = sight.R * point + sight.t;
  if (!(in_camera.z() >= kNearestPointDepth)) return std::nullopt;
  return Vector2d(sight.unit_from_plane * (in_camera.hnormalized() - sight.plane));
}

std::optional<Vector3d> meeting_point(const Sight& a, const Sight& b, double smallest_angle) {
  const double cosine = a.direction.dot(b.direction), squared_sine = 1.0 - cosine * cosine;
  if (!(squared_sine >= std::pow(std::sin(smallest_angle), 2)) || squared_sine <= 0.0) return std::nullopt;
  const Vector3d apart = b.centre - a.centre;
  const double s = (apart.dot(a.direction) - cosine * apart.dot(b.direction)) / squared_sine;
  const double t = (cosine * apart.dot(a.direction) - apart.dot(b.direction)) / squared_sine;
  return Vector3d(0.5 * (a.centre + s * a.direction + b.centre + t * b.direction));
}

std::optional<TriangulatedPoint> triangulate(std::span<const Sight> sights, const TriangulationOptions& options) {
  const Inliers best = best_of_pairs(sights, options);
  if (best.sights.size() < 2) return std::nullopt;
  // Under a kernel, the middle of views that disagree is no start: it may lead to another minimum.
  const auto nearest = best.cost ? best.proposed : nearest_point(best.sights);
  if (!nearest) return std::nullopt;
  TriangulatedPoint point;
  point.position = *nearest;
  const double kernel = options.kernel > 0.0 ? options.kernel : std::numeric_limits<double>::infinity();
  double cost = cost_of(best.sights, point.position, kernel);
  for (int step = 0; step < options.refinement_steps && std::isfinite(cost); ++step)
    if (!refine(best.sights, kernel, point.position, cost)) break;
  double squares = 0.0;
  for (const Sight& sight : sights) {
    point.residuals.push_back(distance_in_view(sight, point.position));
    if (!(point.residuals.back() <= options.inlier_threshold)) continue;
    ++point.views;
    squares += point.residuals.back() * point.residuals.back();
  }
  if (point.views < 2) return std::nullopt;
  point.error = std::sqrt(squares / point.views);
  return point;
}

}  // namespace doppel
