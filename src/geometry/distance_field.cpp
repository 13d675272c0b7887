#include "doppel/geometry/distance_field.h"

#include <algorithm>
#include <cmath>

namespace doppel {

using Eigen::Vector3d;

Vector3d field_gradient(const DistanceField& field, const Vector3d& p) {
  constexpr double kStep = 1e-4;
  Vector3d g;
  for (int axis = 0; axis < 3; ++axis) {
    const Vector3d step = kStep * Vector3d::Unit(axis);
    g[axis] = (field(p + step) - field(p - step)) / (2 * kStep);
  }
  return g;
}

Vector3d project_to_field(const DistanceField& field, const Vector3d& p) {
  Vector3d x = p;
  for (int step = 0; step < 4; ++step) {
    const Vector3d g = field_gradient(field, x);
    const double slope = g.squaredNorm();
    if (slope < 1e-3) break;
    const Vector3d move = field(x) / slope * g;
    x -= move.norm() > 0.01 ? Vector3d(move * (0.01 / move.norm())) : move;
  }
  return x;
}

double smooth_min(double a, double b, double k) {
  const double h = std::max(k - std::abs(a - b), 0.0) / k;
  return std::min(a, b) - h * h * k * 0.25;
}

double smooth_max(double a, double b, double k) { return -smooth_min(-a, -b, k); }

double smooth_step(double low, double high, double x) {
  const double t = std::clamp((x - low) / (high - low), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

double round_cone(const Vector3d& p, const Vector3d& a, const Vector3d& b, double ra, double rb) {
  const Vector3d axis = b - a, from_a = p - a;
  const double t = std::clamp(from_a.dot(axis) / axis.squaredNorm(), 0.0, 1.0);
  return (from_a - t * axis).norm() - (ra + t * (rb - ra));
}

double ellipsoid(const Vector3d& p, const Vector3d& centre, const Vector3d& radii) {
  const Vector3d q = p - centre;
  const double k0 = q.cwiseQuotient(radii).norm();
  const double k1 = q.cwiseQuotient(radii.cwiseProduct(radii)).norm();
  return k1 > 1e-12 ? k0 * (k0 - 1) / k1 : -radii.minCoeff();
}

}  // namespace doppel
