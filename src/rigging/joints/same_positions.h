#pragma once

#include <Eigen/Core>
#include <vector>

namespace doppel {

/// The position of each vertex [N], numbered from 0. Vertices at equal positions, as along seams, share a position.
std::vector<int> same_positions(const std::vector<Eigen::Vector3d>& vertices);

}  // namespace doppel
