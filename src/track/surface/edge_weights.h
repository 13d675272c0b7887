#pragma once

#include <vector>

#include "doppel/geometry/topology.h"

namespace doppel {

/// The weight of each edge in (4.12) and (4.13). Their sums run over the neighbours of every vertex and contain each
/// edge twice: s_ij / |N_i| + s_ij / |N_j|, with s_ij = (s_i + s_j) / 2 of the materials (Table 4.1).
/// @param rigidity [N] s_i @return [edges]
std::vector<double> edge_weights(const MeshTopology& topology, const std::vector<double>& rigidity);

}  // namespace doppel
