#pragma once

/// Isometry loss: edges keep their lengths in the template but may rotate. Wrinkles need rotating edges, which the
/// Laplacian loss penalises (6.12.3.3).
///
///   L = sum over batch and directed edges (i,j) of (|V_i - V_j| - l_ij)^2 / (B * 2E)
///
/// Metres; a weight for millimetres must be multiplied by 1e6. Letters: B batch, N vertices, E undirected edges.

#include <torch/types.h>

#include "doppel/geometry/topology.h"

namespace doppel {

/// The edges of a mesh with their lengths.
struct EdgeLengths {
  /// @param rest [N,3] positions that give l, any float type @throws UsageError for another number of vertices
  EdgeLengths(const MeshTopology& topology, const torch::Tensor& rest);

  int64_t num_vertices;
  torch::Tensor ends;    ///< int64 [E,2]
  torch::Tensor length;  ///< float64 [E]
};

/// @param vertices [B,N,3] any float type @return scalar >= 0; 0 without items or edges
/// Gradient: to the vertices; 0 for an edge without length.
/// @throws UsageError with the shape found
torch::Tensor isometry_loss(const torch::Tensor& vertices, const EdgeLengths& rest);

}  // namespace doppel
