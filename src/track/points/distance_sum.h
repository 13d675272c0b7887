#pragma once

#include <Eigen/Core>
#include <span>

#include "doppel/geometry/triangulation.h"

namespace doppel {

/// Moves a point to where the weighted sum of the lengths of its residuals is smallest (not of their squares: errors of
/// a detector have long tails, and a view that is far off then pulls no more than one that is near).
/// @param start a point in front of the cameras, world metres
/// @param within views whose residual at `start` is longer do not count, in the unit of the sights
/// @return `start` itself where fewer than two views count or the views do not determine a point
Eigen::Vector3d least_distance_sum(std::span<const Sight> sights, const Eigen::Vector3d& start, double within);

}  // namespace doppel
