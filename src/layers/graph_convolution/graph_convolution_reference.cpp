#include <torch/csrc/jit/frontend/tracer.h>
#include <torch/types.h>

#include "doppel/core/tensor/reference_scope.h"
#include "doppel/layers/graph_convolution/graph_convolution.h"
#include "doppel/layers/transform_math.h"

namespace doppel {

using torch::Tensor;

namespace {

/// An index on the device of `like`. If it is already there, it is returned unchanged, and a trace records nothing.
Tensor on_device_of(const Tensor& index, const Tensor& like) {
  return index.device() == like.device() ? index : index.to(like.device());
}

/// Traces for LibTorch take one fused sum of rows. A trace inside a ReferenceScope keeps to the plain definition, whose
/// operations other runtimes have too.
bool traces_sums_of_rows() { return torch::jit::tracer::isTracing() && !in_reference_scope(); }

/// out[i] = the sum over the entries of bag i, from offsets[i] on, of weights[e] table[items[e]]. torch computes it in
/// one pass at memory bandwidth. It has no second derivative.
Tensor sums_of_rows(const Tensor& table, const Tensor& items, const Tensor& offsets, const Tensor& weights) {
  constexpr int64_t kSum = 0;
  return std::get<0>(at::embedding_bag(table, items, offsets, /*scale_grad_by_freq=*/false, kSum, /*sparse=*/false,
                                       weights, /*include_last_offset=*/false));
}

/// apply_kernels as sums of rows: K_l f_l is the sum of the rows of K_l with weights f_l. Bags are (item of the batch,
/// node); the batch size must not become a constant in a trace.
Tensor apply_kernels_by_rows(const Tensor& features, const Tensor& kernels) {
  const int64_t K = kernels.size(0), Hin = kernels.size(1), Hout = kernels.size(2);
  const auto ints = features.options().dtype(at::kInt);
  const Tensor rows = at::arange(K * Hin, ints).unsqueeze(0).expand_as(features.flatten(1));
  const Tensor item = at::ones_like(features.select(1, 0).narrow(1, 0, 1), ints).cumsum(0, at::kInt) - 1;
  const Tensor offsets = item * (K * Hin) + at::arange(0, K * Hin, Hin, ints);
  const Tensor z = sums_of_rows(kernels.flatten(0, 1), rows.flatten(), offsets.flatten(), features.flatten());
  return z.view({-1, K, Hout}).transpose(0, 1);
}

/// z_l = K_l f_l for every node: [B,K,Hin] -> [K,B,Hout].
Tensor apply_kernels(const Tensor& features, const Tensor& kernels) {
  // A traced model runs without the kernel, and torch multiplies thousands of small matrices one by one.
  if (traces_sums_of_rows()) return apply_kernels_by_rows(features, kernels);
  return at::bmm(features.transpose(0, 1), kernels);
}

/// sum_l a_kl z_l of rows z [K,X].
Tensor mix_neighbours(const Tensor& z, const RingWeights& ring) {
  const bool single = z.scalar_type() == at::kFloat;
  if (traces_sums_of_rows()) {
    const Tensor weights = constant_like(single ? ring.entry_weights_float : ring.entry_weights, z);
    return sums_of_rows(z, on_device_of(ring.entries, z), on_device_of(ring.entry_offsets, z), weights);
  }
  const int64_t K = ring.num_nodes, P = ring.neighbours.size(1);
  const Tensor weights = (single ? ring.weights_float : ring.weights).to(z.device(), z.scalar_type());
  const Tensor gathered = z.index_select(0, ring.neighbours.to(z.device()).flatten()).view({K, P, -1});
  return at::bmm(weights.unsqueeze(1), gathered).squeeze(1);
}

}  // namespace

Tensor graph_convolution_reference(const Tensor& features, const Tensor& kernels, const Tensor& bias,
                                   const RingWeights& ring) {
  const Tensor z = apply_kernels(features, kernels);
  if (features.size(0) == 0) return z.transpose(0, 1) + bias;
  const Tensor mixed = mix_neighbours(z.flatten(1), ring).view({ring.num_nodes, -1, kernels.size(2)});
  return mixed.transpose(0, 1) + bias;
}

Tensor node_norm_reference(const Tensor& features, const NodeNorm& norm) {
  if (!norm.defined()) return features;
  if (features.size(0) == 0) return features * norm.weight + norm.bias;  // no statistics, but zero gradients
  const int64_t K = features.size(1), H = features.size(2);
  return at::batch_norm(features.flatten(1), norm.weight.flatten(), norm.bias.flatten(), norm.running_mean.view({-1}),
                        norm.running_var.view({-1}), norm.training, norm.momentum, norm.epsilon, false)
      .view({-1, K, H});
}

Tensor dense_broadcast(const Tensor& features, const Tensor& kernels, const Tensor& bias, double scale) {
  const Tensor sum = apply_kernels(features, kernels).sum(0);  // one vector per item of the batch
  return (sum * scale).unsqueeze(1) + bias;
}

Tensor dense_matrix(const Tensor& features, const Tensor& matrix, const Tensor& bias) {
  return at::matmul(matrix, features) + bias;
}

}  // namespace doppel
