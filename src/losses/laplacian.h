#pragma once

/// Laplacian loss: neighbouring vertices should have similar displacements.
///
///   L = sum over batch and vertices of w_i |n_i d_i - sum over neighbours j of d_j|^2 / (B * 2E),   d = V_fi - V_co
///
/// n_i neighbours of vertex i (sums, not means), E undirected edges, w_i the rigidity s_i of the vertex or of its edges
/// (LaplacianOptions), V in metres. Equation: 6.17, whose sum over the vertices is not divided. Letters: B batch, N
/// vertices.

#include <torch/types.h>

#include <vector>

#include "doppel/character/character.h"
#include "doppel/geometry/topology.h"

namespace doppel {

/// The weight w_i of a vertex: its rigidity s_i as in 6.17 (`vertex`), or the mean over its neighbours of
/// (s_i + s_j) / 2 as in the public code (`edges`).
enum class LaplacianWeights { vertex, edges };

struct LaplacianOptions {
  RigidityPreset rigidity = RigidityPreset::laplacian;  ///< the table of s_i
  LaplacianWeights weights = LaplacianWeights::edges;
};

/// The edges of a mesh with the weight of each vertex.
struct LaplacianGraph {
  LaplacianGraph() = default;
  /// Edges of the template; s_i from its labels (1 without labels).
  explicit LaplacianGraph(const Character& character, const LaplacianOptions& options = {});
  /// @param rigidity s_i [N] @throws Error when the sizes differ
  LaplacianGraph(const MeshTopology& topology, const std::vector<double>& rigidity,
                 LaplacianWeights weights = LaplacianWeights::edges);

  std::int64_t num_vertices = 0;
  std::int64_t num_edges = 0;         ///< directed, 2E
  torch::Tensor offsets, neighbours;  ///< int32 [N+1], [2E]: neighbours of i are rows offsets[i] .. offsets[i+1]
  torch::Tensor source, target;       ///< int64 [2E], the same edges one by one
  torch::Tensor weight;               ///< float64 [N], w_i; 0 without neighbours
  torch::Tensor weight_float;         ///< float32 [N]
};

/// @param V_fi [B,N,3] vertices with displacements, metres
/// @param V_co [B,N,3] the same without, in the same pose
/// @return scalar; 0 without items or edges
/// Gradient: to V_fi only. V_co, the posed surface without displacements, is a constant.
/// @throws UsageError with the shape found
torch::Tensor laplacian_loss(const torch::Tensor& V_fi, const torch::Tensor& V_co, const LaplacianGraph& graph);
/// The same in plain tensor operations: any device and float type.
torch::Tensor laplacian_loss_reference(const torch::Tensor& V_fi, const torch::Tensor& V_co,
                                       const LaplacianGraph& graph);

}  // namespace doppel
