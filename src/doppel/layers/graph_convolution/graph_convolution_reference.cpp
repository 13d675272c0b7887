#include <ATen/ATen.h>

#include "doppel/layers/graph_convolution/graph_convolution.h"

namespace doppel {

using torch::Tensor;

namespace {

/// z_l = K_l f_l for every node: [B,K,Hin] -> [K,B,Hout].
Tensor apply_kernels(const Tensor& features, const Tensor& kernels) {
  return at::bmm(features.transpose(0, 1), kernels);
}

}  // namespace

Tensor graph_convolution_reference(const Tensor& features, const Tensor& kernels, const Tensor& bias,
                                   const RingWeights& ring) {
  const int64_t K = ring.num_nodes, P = ring.neighbours.size(1), H = kernels.size(2);
  const Tensor z = apply_kernels(features, kernels);
  if (features.size(0) == 0) return z.transpose(0, 1) + bias;

  const bool single = features.scalar_type() == at::kFloat;
  const Tensor weights = (single ? ring.weights_float : ring.weights).to(features.device(), features.scalar_type());
  const Tensor neighbours = ring.neighbours.to(features.device());
  // The batch size must not become a constant in a trace, so it is the one dimension left open.
  const Tensor gathered = z.flatten(1).index_select(0, neighbours.flatten()).view({K, P, -1});
  const Tensor mixed = at::bmm(weights.unsqueeze(1), gathered).view({K, -1, H});
  return mixed.transpose(0, 1) + bias;
}

Tensor node_norm_reference(const Tensor& features, const NodeNorm& norm) {
  if (!norm.defined()) return features;
  if (features.size(0) == 0) return features * norm.weight + norm.bias;  // no statistics of nothing, but zero gradients
  const int64_t K = features.size(1), H = features.size(2);
  return at::batch_norm(features.flatten(1), norm.weight.flatten(), norm.bias.flatten(), norm.running_mean.view({-1}),
                        norm.running_var.view({-1}), norm.training, norm.momentum, norm.epsilon, false)
      .view({-1, K, H});
}

Tensor dense_broadcast(const Tensor& features, const Tensor& kernels, const Tensor& bias, double scale) {
  // One vector per batch item: the sum over nodes and inputs is a single matrix product.
  const Tensor sum = at::matmul(features.flatten(1), kernels.flatten(0, 1));
  return (sum * scale).unsqueeze(1) + bias;
}

Tensor dense_matrix(const Tensor& features, const Tensor& matrix, const Tensor& bias) {
  return at::matmul(matrix, features) + bias;
}

}  // namespace doppel
