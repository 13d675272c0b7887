#pragma once

/// As-rigid-as-possible loss on the embedded graph: a node's rotation should predict the positions of its neighbours.
///
///   L = mean over directed edges (k,l) and the batch of  u_kl |R(A_k) (g_l - g_k) + g_k + T_k - (g_l + T_l)|_1
///
/// Equation: 6.9. Metres. |.|_1 is the sum of the absolute values of the three components. Each undirected edge counts
/// in both directions. Letters: B batch, K nodes, E directed edges.

#include <torch/types.h>

#include "doppel/character/character.h"

namespace doppel {

/// The edges of a graph with their rigidity, sorted by source.
struct ArapGraph {
  ArapGraph() = default;
  /// u_kl = (u_k + u_l) / 2 with u_k the mean rigidity of the vertices node k influences.
  explicit ArapGraph(const Character& character);
  /// @param nodes [K] rest positions @param edges undirected @param node_rigidity u_k [K]
  /// @throws Error when the sizes differ or an edge names no node
  ArapGraph(const std::vector<Eigen::Vector3d>& nodes, const std::vector<std::array<int, 2>>& edges,
            const std::vector<double>& node_rigidity);

  int64_t num_nodes = 0;
  torch::Tensor source, target;  ///< int64 [E]
  torch::Tensor rigidity;        ///< float64 [E], u_kl
  torch::Tensor rest;            ///< float64 [E,3], g_l - g_k
  // For the kernel: the edges of node k are offsets[k] .. offsets[k+1].
  torch::Tensor offsets, targets;            ///< int32 [K+1], int32 [E]
  torch::Tensor rigidity_float, rest_float;  ///< float32
};

/// @param A [B,K,3] Euler angles @param T [B,K,3] translations
/// @return scalar; 0 without edges or items
/// Gradients: to A and T. The subgradient of a residual component that is exactly 0 is 0. No second derivative.
/// @throws Error with the shape found
torch::Tensor arap_loss(const torch::Tensor& A, const torch::Tensor& T, const ArapGraph& graph);
/// The same in plain tensor operations: any device and float type.
torch::Tensor arap_loss_reference(const torch::Tensor& A, const torch::Tensor& T, const ArapGraph& graph);

}  // namespace doppel
