#pragma once

#include <cstdint>

#include "doppel/core/cpu_dispatch.h"

namespace doppel::kernels {

/// A float tensor indexed as [batch][node][feature] in either layout. The features of a node are contiguous.
struct GraphFeatures {
  float* data = nullptr;
  int64_t batch_stride = 0, node_stride = 0;
};
struct ConstGraphFeatures {
  const float* data = nullptr;
  int64_t batch_stride = 0, node_stride = 0;
};

/// One convolution, forward or backward. "Packed" arrays follow `order`, with one row of batch * padded(features)
/// floats per node. padded() rounds up to the vector width, so that inner loops have no remainder.
struct GraphConvolutionParams {
  int64_t nodes = 0, batch = 0, inputs = 0, outputs = 0;

  // the ring weights (RingWeights::packed)
  const int32_t* order = nullptr;
  const int32_t* positions = nullptr;
  const int32_t* offsets = nullptr;
  const int32_t* columns = nullptr;
  const float* values = nullptr;
  const float* transposed_values = nullptr;

  ConstGraphFeatures features;
  const float* kernels = nullptr;  ///< [nodes][inputs][outputs]
  const float* bias = nullptr;     ///< [nodes][outputs]
  ConstGraphFeatures skip;         ///< data may be null
  GraphFeatures output;

  // norm and ELU before the convolution; norm_weight may be null. All [nodes][inputs].
  bool elu = false;
  bool batch_statistics = false;
  float momentum = 0.0f, epsilon = 0.0f;
  const float* norm_weight = nullptr;
  const float* norm_bias = nullptr;
  float* running_mean = nullptr;
  float* running_var = nullptr;
  float* mean = nullptr;  ///< statistics of the normalisation: written forward, read backward
  float* inverse_std = nullptr;

  // backward
  ConstGraphFeatures grad_output;
  float* grad_kernels = nullptr;
  float* grad_bias = nullptr;
  float* grad_norm_weight = nullptr;
  float* grad_norm_bias = nullptr;
  GraphFeatures grad_features;  ///< data is null when not wanted

  float* packed = nullptr;  ///< workspace [nodes][batch * padded(outputs)]
};

/// Floats per vector in the instruction set in use.
DOPPEL_DECLARE_KERNEL(int64_t, graph_convolution_width, ())
/// The number of floats of scratch memory per thread, 64-byte aligned.
DOPPEL_DECLARE_KERNEL(int64_t, graph_convolution_scratch, (const GraphConvolutionParams& p))

// Forward: `transform` for all nodes, then `gather` for all packed rows. Backward: `pack`, then `backward`. Each call
// covers the packed rows (for `transform`, the nodes) [begin, end) and writes only their results, so any split gives
// the same bits.

/// packed[positions[l]] = act(f_l) K_l for the nodes l of [begin, end). Kernels are read in the order of memory.
DOPPEL_DECLARE_KERNEL(void, graph_convolution_transform,
                      (const GraphConvolutionParams& p, float* scratch, int64_t begin, int64_t end))
/// output[k] = b_k + sum_l a_kl packed[l] (+ skip[k]).
DOPPEL_DECLARE_KERNEL(void, graph_convolution_gather,
                      (const GraphConvolutionParams& p, float* scratch, int64_t begin, int64_t end))
/// packed[p] = grad_output[order[p]] and grad_bias, its sum over the batch.
DOPPEL_DECLARE_KERNEL(void, graph_convolution_pack,
                      (const GraphConvolutionParams& p, float* scratch, int64_t begin, int64_t end))
/// The rest of the backward pass.
DOPPEL_DECLARE_KERNEL(void, graph_convolution_backward,
                      (const GraphConvolutionParams& p, float* scratch, int64_t begin, int64_t end))

// The dense block: every node receives the same sum.

constexpr int64_t kGraphDenseBlock = 64;  ///< nodes whose sum is taken in one piece

/// packed[i] = sum of act(f_l) K_l over block i of kGraphDenseBlock nodes, for blocks [begin, end).
DOPPEL_DECLARE_KERNEL(void, graph_dense_sum,
                      (const GraphConvolutionParams& p, float* scratch, int64_t begin, int64_t end))
/// grad_kernels and grad_features of nodes [begin, end); grad_output is the gradient [batch][outputs] of the sum.
DOPPEL_DECLARE_KERNEL(void, graph_dense_backward,
                      (const GraphConvolutionParams& p, float* scratch, int64_t begin, int64_t end))

}  // namespace doppel::kernels
