#pragma once

#include <Eigen/Core>
#include <vector>

namespace doppel {

/// The place of each vertex [N], numbered from 0. Vertices at equal positions, as along seams, share a place.
std::vector<int> same_places(const std::vector<Eigen::Vector3d>& vertices);

}  // namespace doppel
