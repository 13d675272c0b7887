#include "doppel/track/points/distance_sum.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <vector>

namespace doppel {

namespace {

constexpr int kSteps = 30;
constexpr double kShortestResidual = 0.1;  // unit of the sights: keeps the weights finite
constexpr double kSmallStep = 1e-6;        // metres

/// A step of least squares in which each residual is divided by its length: minimises the sum of lengths, repeated.
Eigen::Vector3d reweighted_step(const std::vector<const Sight*>& sights, const Eigen::Vector3d& point) {
  Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  for (const Sight* sight : sights) {
    const auto residual = residual_of(*sight, point);
    if (!residual) continue;
    const Eigen::Vector3d p = sight->R * point + sight->t;
    Eigen::Matrix<double, 2, 3> projection;
    projection << 1.0 / p.z(), 0.0, -p.x() / (p.z() * p.z()), 0.0, 1.0 / p.z(), -p.y() / (p.z() * p.z());
    const Eigen::Matrix<double, 2, 3> jacobian = sight->unit_from_plane * projection * sight->R;
    const double weight = sight->weight / std::max(residual->norm(), kShortestResidual);
    hessian += weight * jacobian.transpose() * jacobian;
    gradient += weight * jacobian.transpose() * *residual;
  }
  return -hessian.ldlt().solve(gradient);
}

}  // namespace

Eigen::Vector3d least_distance_sum(std::span<const Sight> sights, const Eigen::Vector3d& start, double within) {
  std::vector<const Sight*> near;
  for (const Sight& sight : sights) {
    const auto residual = residual_of(sight, start);
    if (residual && residual->norm() <= within) near.push_back(&sight);
  }
  if (near.size() < 2) return start;
  Eigen::Vector3d point = start;
  for (int i = 0; i < kSteps; ++i) {
    const Eigen::Vector3d step = reweighted_step(near, point);
    if (!step.allFinite()) return start;
    point += step;
    if (step.norm() < kSmallStep) break;
  }
  return point;
}

}  // namespace doppel
