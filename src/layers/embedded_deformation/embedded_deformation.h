#pragma once

/// Embedded deformation: the graph deforms the template, displacements refine it, and node transforms pose it.
///
///   y_i = D_i + sum_k w_ik (R(A_k) (v_i - g_k) + g_k + T_k)          Equation: 6.2
///   x_i = sum_k w_ik M_k y_i                                          Equation: 6.3
///
/// R(A) = Rz(A_3) Ry(A_2) Rx(A_1). Letters: B batch, N vertices, K nodes. Metres, radians.

#include <torch/nn/module.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include "doppel/character/character.h"
#include "doppel/layers/sparse_rows.h"

namespace doppel {

/// The constants of the layer. `rest` and `nodes` are float64 on the CPU.
struct DeformationGraph {
  DeformationGraph() = default;
  explicit DeformationGraph(const Character& character);
  /// @param rest [N] vertices, @param nodes [K] node positions, @param vertex_nodes, weights w_ik
  DeformationGraph(const std::vector<Eigen::Vector3d>& rest, const std::vector<Eigen::Vector3d>& nodes,
                   const IndexRows& vertex_nodes, const std::vector<double>& weights);

  torch::Tensor rest;         ///< float64 [N,3]
  torch::Tensor nodes;        ///< float64 [K,3]
  torch::Tensor rest_float;   ///< float32 [N,3], relative to the centre of the template
  torch::Tensor nodes_float;  ///< float32 [K,3], likewise
  torch::Tensor centre;       ///< float32 [3]
  SparseRows weights;         ///< vertices over nodes
};

/// Deformed vertices: canonical (6.2) without node transforms, posed (6.3) with them.
/// @param A  [B,K,3] Euler angles of the nodes
/// @param T  [B,K,3] translations of the nodes
/// @param D  [B,N,3] displacements, or undefined for none
/// @param node_transforms  [B,K,3,4], or undefined for the canonical pose
/// @return [B,N,3]
/// Gradients: to all four. No second derivative.
/// @throws Error naming the argument, with the shape found
torch::Tensor embedded_deformation(const torch::Tensor& A, const torch::Tensor& T, const torch::Tensor& D,
                                   const torch::Tensor& node_transforms, const DeformationGraph& graph);
/// The same in plain tensor operations: any device and float type, traceable.
torch::Tensor embedded_deformation_reference(const torch::Tensor& A, const torch::Tensor& T, const torch::Tensor& D,
                                             const torch::Tensor& node_transforms, const DeformationGraph& graph);

/// [...,3] angles about x, y, z -> [...,3,3] = Rz Ry Rx.
torch::Tensor euler_to_matrix(const torch::Tensor& angles);
/// The inverse. The angle about y lies in [-pi/2, pi/2]. If it is within 1e-6 of the pole, the angle about z is 0.
torch::Tensor matrix_to_euler(const torch::Tensor& rotation);

/// Embedded deformation of a character.
class EmbeddedDeformationImpl : public torch::nn::Module {
 public:
  explicit EmbeddedDeformationImpl(const Character& character);
  explicit EmbeddedDeformationImpl(DeformationGraph graph);

  torch::Tensor forward(const torch::Tensor& A, const torch::Tensor& T, const torch::Tensor& D = {},
                        const torch::Tensor& node_transforms = {}) const;

  const DeformationGraph& graph() const { return graph_; }
  void pretty_print(std::ostream& stream) const override;

 private:
  DeformationGraph graph_;
};
TORCH_MODULE(EmbeddedDeformation);

}  // namespace doppel
