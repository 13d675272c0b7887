#pragma once

/// Embedded deformation of a template: the embedded graph deforms it, displacements refine the result, and node
/// transforms pose it.
///
///   y_i = D_i + sum_k w_ik (R(A_k) (v_i - g_k) + g_k + T_k)          Equation: 6.2
///   x_i = sum_k w_ik M_k y_i                                          Equation: 6.3
///
/// Vertex i of the template is v_i. Node k has the position g_k, the angles A_k = (A_1, A_2, A_3) about x, y, z, the
/// translation T_k and the skinning transform M_k. w_ik is the weight of node k for vertex i, and
/// R(A) = Rz(A_3) Ry(A_2) Rx(A_1). v, g, T, D and y refer to the canonical pose: the template in its rest pose, world
/// axes. x is the posed vertex in the world. Letters: B batch, N vertices, K nodes. Metres, radians.

#include <torch/nn/module.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include "doppel/character/character.h"
#include "doppel/layers/sparse_rows.h"

namespace doppel {

/// The constants of the layer. All tensors are on the CPU. The default constructor leaves them undefined.
struct DeformationGraph {
  DeformationGraph() = default;
  explicit DeformationGraph(const Character& character);
  /// @param rest [N] vertices v_i of the template, metres @param nodes [K] positions g_k, metres
  /// @param vertex_nodes [N] rows: the nodes that influence each vertex
  /// @param weights w_ik, one for each of `vertex_nodes.items`; those of a vertex sum to 1
  /// @throws Error when the number of rows is not N, a vertex has no node, a node does not exist, or the weights of a
  /// vertex do not sum to 1
  DeformationGraph(const std::vector<Eigen::Vector3d>& rest, const std::vector<Eigen::Vector3d>& nodes,
                   const IndexRows& vertex_nodes, const std::vector<double>& weights);

  torch::Tensor rest;         ///< float64 [N,3] v_i
  torch::Tensor nodes;        ///< float64 [K,3] g_k
  torch::Tensor rest_float;   ///< float32 [N,3] v_i - centre
  torch::Tensor nodes_float;  ///< float32 [K,3] g_k - centre
  torch::Tensor centre;       ///< float32 [3] mean of the vertices v_i
  SparseRows weights;         ///< w_ik: one row per vertex, one column per node
};

/// Deforms the template. The result is y (6.2, canonical pose) without node transforms, and x (6.3, world) with them.
/// @param A [B,K,3] Euler angles of the nodes, radians
/// @param T [B,K,3] translations of the nodes, metres, canonical pose
/// @param D [B,N,3] displacements of the vertices, metres, canonical pose; undefined: none
/// @param node_transforms [B,K,3,4] M_k, from canonical pose to world (`CharacterSurface::node_transforms`); undefined:
/// the vertices are not posed
/// @return [B,N,3] metres
/// Gradients go to A, T, D and node_transforms. float32 on the CPU runs the kernel, which has no second derivative.
/// Everything else, and a torch::jit trace, runs the reference.
/// @throws UsageError that names the argument, for another shape, or for a type or device other than that of A
torch::Tensor embedded_deformation(const torch::Tensor& A, const torch::Tensor& T, const torch::Tensor& D,
                                   const torch::Tensor& node_transforms, const DeformationGraph& graph);
/// The same in plain tensor operations: any device and float type, with second derivatives; can be traced.
torch::Tensor embedded_deformation_reference(const torch::Tensor& A, const torch::Tensor& T, const torch::Tensor& D,
                                             const torch::Tensor& node_transforms, const DeformationGraph& graph);

/// Rotation matrices of Euler angles. @param angles [...,3] about x, y, z, radians @return [...,3,3] Rz Ry Rx
/// @throws UsageError for another shape
torch::Tensor euler_to_matrix(const torch::Tensor& angles);
/// The inverse of `euler_to_matrix`. The angle about y lies in [-pi/2, pi/2]. Within 1e-6 radians of either end the
/// other two angles are not unique, and the angle about z is 0. Gradients are finite everywhere.
/// @param rotation [...,3,3] @return [...,3] angles about x, y, z, radians
/// @throws UsageError for another shape
torch::Tensor matrix_to_euler(const torch::Tensor& rotation);

/// `embedded_deformation` as a module that holds the constants. It has no parameters and no buffers.
class EmbeddedDeformationImpl : public torch::nn::Module {
 public:
  explicit EmbeddedDeformationImpl(const Character& character);
  explicit EmbeddedDeformationImpl(DeformationGraph graph);

  /// Arguments, result and errors as for `embedded_deformation`.
  torch::Tensor forward(const torch::Tensor& A, const torch::Tensor& T, const torch::Tensor& D = {},
                        const torch::Tensor& node_transforms = {}) const;

  const DeformationGraph& graph() const { return graph_; }
  void pretty_print(std::ostream& stream) const override;

 private:
  DeformationGraph graph_;
};
TORCH_MODULE(EmbeddedDeformation);

}  // namespace doppel
