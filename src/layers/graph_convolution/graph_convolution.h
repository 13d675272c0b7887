#pragma once

/// Structure-aware graph convolution: every node has its own kernel, and ring weights mix neighbours.
///
///   f'_k = b_k + sum_l a_kl K_l f_l                 Equation: 6.5
///   a_kl = r_kl / sum_l r_kl,  r_kl = R - hops(k,l)  Equation: 6.6
///
/// Shapes: B batch, K nodes, Hin/Hout features. There are two layouts: `[B,K,H]`, the public layout, and node-major
/// `[K,B,H]`, which a network can use from stem to head. Kernels are `[K,Hin,Hout]` (node, in, out), so K_l f_l is a
/// row vector times a matrix.
///
/// float32 on the CPU runs the fused kernel, everything else the reference in plain tensor operations. Gradients go to
/// every tensor argument. The kernel has no second derivative.

#include <torch/nn/cloneable.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include <cstdint>
#include <vector>

namespace doppel {

struct EmbeddedGraph;
class MeshTopology;

/// The matrix a_kl of 6.6, prepared once per graph. Nodes at `rings` hops have weight 0 and are left out, so "R = 3"
/// reaches two hops. Copies share the tensors, which do not change after construction.
struct RingWeights {
  int64_t num_nodes = 0;
  int rings = 0;
  int64_t num_entries = 0;

  // For the reference: rows padded to the longest one; padding has weight 0.
  torch::Tensor neighbours;     ///< int64 [K,P]
  torch::Tensor weights;        ///< float64 [K,P]
  torch::Tensor weights_float;  ///< the same in float32

  // The same rows without padding, for traces.
  torch::Tensor entries;              ///< int32 [E]
  torch::Tensor entry_offsets;        ///< int32 [K], first entry of each row
  torch::Tensor entry_weights;        ///< float64 [E]
  torch::Tensor entry_weights_float;  ///< the same in float32

  // For the kernel: nodes renumbered so that neighbours are close in memory. Row p belongs to node order[p]; columns
  // are indices into that order. The sparsity pattern is symmetric, so the transpose has the same pattern.
  torch::Tensor order;              ///< int32 [K]
  torch::Tensor positions;          ///< int32 [K], the inverse of `order`: positions[order[p]] = p
  torch::Tensor offsets;            ///< int32 [K+1]
  torch::Tensor columns;            ///< int32 [E]
  torch::Tensor values;             ///< float32 [E] a_kl in row k
  torch::Tensor transposed_values;  ///< float32 [E] a_lk in row k

  /// @throws Error for rings < 1 or an empty graph
  static RingWeights from_topology(const MeshTopology& topology, int rings);
  static RingWeights from_graph(const EmbeddedGraph& graph, int rings);

  /// order, positions, offsets, columns, values, transposed_values: the `ring` argument of the dispatcher ops.
  std::vector<torch::Tensor> packed() const { return {order, positions, offsets, columns, values, transposed_values}; }
};

/// Equation 6.5 in the public layout.
/// @param features [B,K,Hin]  @param kernels [K,Hin,Hout]  @param bias [K,Hout]
/// @return [B,K,Hout]
/// @throws Error naming the argument and the shape received
torch::Tensor graph_convolution(const torch::Tensor& features, const torch::Tensor& kernels, const torch::Tensor& bias,
                                const RingWeights& ring);
/// The same with features [K,B,Hin] -> [K,B,Hout].
torch::Tensor graph_convolution_node_major(const torch::Tensor& features, const torch::Tensor& kernels,
                                           const torch::Tensor& bias, const RingWeights& ring);

/// Batch normalisation of each (node, feature) separately, over the batch. An undefined `weight` means none.
struct NodeNorm {
  torch::Tensor weight, bias;               ///< [K,H]
  torch::Tensor running_mean, running_var;  ///< [K,H], updated in place while training
  bool training = false;                    ///< batch statistics (needs B > 1) or the running ones
  double momentum = 0.003;                  ///< running = (1 - momentum) running + momentum new
  double epsilon = 1e-5;

  bool defined() const { return weight.defined(); }
};

/// Half a residual block in one pass: skip + conv(elu(norm(features))). Everything except the neighbourhood sum is
/// local to a node, so the memory traffic is that of the convolution alone.
/// @param features [K,B,Hin]
/// @param norm   applied first, when defined
/// @param skip   [K,B,Hout] added to the result, or an undefined tensor
/// @return [K,B,Hout]
/// @throws Error also for norm.training with B = 1
torch::Tensor elu_graph_convolution_node_major(const torch::Tensor& features, const NodeNorm& norm,
                                               const torch::Tensor& kernels, const torch::Tensor& bias,
                                               const RingWeights& ring, const torch::Tensor& skip = {});

/// The definitions, in plain tensor operations of any dtype, batch-first. Traceable.
torch::Tensor graph_convolution_reference(const torch::Tensor& features, const torch::Tensor& kernels,
                                          const torch::Tensor& bias, const RingWeights& ring);
/// @param features [B,K,H] -> [B,K,H]
torch::Tensor node_norm_reference(const torch::Tensor& features, const NodeNorm& norm);

/// 6.5.3 with all a_kl equal: f'_k = b_k + scale * sum_l K_l f_l, the same sum for every node. Plain tensor operations.
/// @param features [B,K,Hin]  @param kernels [K,Hin,Hout]  @param bias [K,Hout]
/// @param scale 1 as the thesis prints it; 1/K (what 6.6 gives for equal weights) keeps the sum from growing with K
torch::Tensor dense_broadcast(const torch::Tensor& features, const torch::Tensor& kernels, const torch::Tensor& bias,
                              double scale);
/// features + dense_broadcast(elu(features)) with features [K,B,H] in one pass over the kernels.
/// @param kernels [K,H,H]  @param bias [K,H] @return [K,B,H]
torch::Tensor elu_dense_broadcast_node_major(const torch::Tensor& features, const torch::Tensor& kernels,
                                             const torch::Tensor& bias, double scale);
/// The dense layer of public checkpoints: f'_k = b_k + sum_l m_kl f_l with a learned matrix shared by all features.
/// @param features [B,K,H]  @param matrix [K,K]  @param bias [K,H]
torch::Tensor dense_matrix(const torch::Tensor& features, const torch::Tensor& matrix, const torch::Tensor& bias);

/// A convolution that owns its `kernels` [K,Hin,Hout] and `bias` [K,Hout], zero until initialised.
class GraphConvolutionImpl : public torch::nn::Cloneable<GraphConvolutionImpl> {
 public:
  GraphConvolutionImpl(RingWeights ring, int inputs, int outputs);
  void reset() override;

  torch::Tensor forward(const torch::Tensor& features);             ///< [B,K,Hin] -> [B,K,Hout]
  torch::Tensor forward_node_major(const torch::Tensor& features);  ///< [K,B,Hin] -> [K,B,Hout]
  torch::Tensor forward_reference(const torch::Tensor& features);   ///< [B,K,Hin] -> [B,K,Hout], traceable

  const RingWeights& ring() const { return ring_; }

  torch::Tensor kernels, bias;

 private:
  RingWeights ring_;
  int inputs_, outputs_;
};
TORCH_MODULE(GraphConvolution);

}  // namespace doppel
