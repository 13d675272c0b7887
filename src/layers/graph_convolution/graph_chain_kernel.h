#pragma once

#include <cstdint>

#include "doppel/core/cpu_dispatch.h"

namespace doppel::kernels {

constexpr int64_t kChainFeatures = 16;  ///< features of a node between the layers
constexpr int64_t kChainBlock = 64;     ///< nodes of a block, the unit of parallel work

/// A step of a graph network on one sample (GraphChain): the end of one convolution and the beginning of the next, for
/// a node at a time, so that the arithmetic of a sum over neighbours hides the reading of kernels. Rows are those of
/// RingWeights::order, [nodes][kChainFeatures] unless a shape is given.
///
///   x_k = skip_k + common + bias_k + scale_k sum_rings sum_(rings up to it) products_l,   y_k = ELU(norm(x_k)) K_k
///
/// The inner sums of a row are those of its rings from the innermost on, so that a neighbour in ring r of R counts
/// R - r times (6.6).
struct GraphChainStep {
  int64_t nodes = 0;

  // the sum over neighbours, without products none
  const float* products = nullptr;
  int64_t rings = 0;
  const uint16_t* short_columns = nullptr;  ///< either these: fewer than 65,536 nodes
  const int32_t* columns = nullptr;         ///< or these
  const int32_t* begins = nullptr;          ///< [nodes * rings + 1] first column of each ring of each row
  const float* scales = nullptr;            ///< [nodes] 1 / sum of the counts
  const float* bias = nullptr;
  const float* skip = nullptr;    ///< null: none
  const float* common = nullptr;  ///< [kChainFeatures], null: none
  float* features = nullptr;      ///< x, null: not wanted

  // norm and ELU, then the next convolution
  const float* norm_scale = nullptr;  ///< null: no norm
  const float* norm_shift = nullptr;
  const void* kernels = nullptr;  ///< null: x alone; float [nodes][in][out], or words of two bfloat16 [nodes][in /
                                  ///< 2][out]: the lower half of a word is of the even input
  float* next = nullptr;          ///< y, null: not wanted
  float* sums = nullptr;          ///< [blocks][kChainFeatures] sum of y over each block, null: not wanted
};

/// The first and the last convolution: y_k = f K with any number of inputs, y_k = ELU(x) K with up to kChainFeatures
/// outputs (those that are left stay 0).
struct GraphChainEnd {
  int64_t nodes = 0, size = 0;      ///< inputs, or outputs
  const int32_t* order = nullptr;   ///< [nodes]
  const float* features = nullptr;  ///< first: [nodes][size] in the order of the graph; last: x
  const float* kernels = nullptr;   ///< first: [nodes][size][kChainFeatures]; last: [nodes][size][kChainFeatures], that
                                    ///< is transposed
  float* next = nullptr;
};

// Each call covers the blocks [begin, end) and writes only their results, so any split gives the same bits.

/// Kernels of GraphChainStep in float.
DOPPEL_DECLARE_KERNEL(void, graph_chain_step, (const GraphChainStep& p, int64_t begin, int64_t end))
/// Kernels of GraphChainStep in bfloat16.
DOPPEL_DECLARE_KERNEL(void, graph_chain_step_short, (const GraphChainStep& p, int64_t begin, int64_t end))
DOPPEL_DECLARE_KERNEL(void, graph_chain_first, (const GraphChainEnd& p, int64_t begin, int64_t end))
DOPPEL_DECLARE_KERNEL(void, graph_chain_last, (const GraphChainEnd& p, int64_t begin, int64_t end))

}  // namespace doppel::kernels
