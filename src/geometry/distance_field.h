#pragma once

#include <Eigen/Core>
#include <functional>

namespace doppel {

/// A closed surface as the zero level of a function of space, metres: negative inside, and near the surface about the
/// distance to it.
using DistanceField = std::function<double(const Eigen::Vector3d&)>;

/// Gradient by central differences.
Eigen::Vector3d field_gradient(const DistanceField& field, const Eigen::Vector3d& p);
/// Moves a point near the surface onto the surface by a few Newton steps.
Eigen::Vector3d project_to_field(const DistanceField& field, const Eigen::Vector3d& p);

/// Polynomial smooth minimum: joins two fields and rounds the crease between them over a width of about k.
double smooth_min(double a, double b, double k);
double smooth_max(double a, double b, double k);
/// 0 below `low`, 1 above `high`, smooth in between (3 t^2 - 2 t^3).
double smooth_step(double low, double high, double x);

/// A cone with spherical ends of radius ra at a and rb at b.
double round_cone(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b, double ra, double rb);
/// An ellipsoid, first-order exact at its surface.
double ellipsoid(const Eigen::Vector3d& p, const Eigen::Vector3d& centre, const Eigen::Vector3d& radii);

}  // namespace doppel
