#pragma once

/// Sparse weights of rows over columns (vertices over bones, vertices over nodes), in the forms that layers read.

#include <torch/types.h>

#include <string>
#include <vector>

#include "doppel/geometry/topology.h"

namespace doppel {

struct SparseRows {
  SparseRows() = default;
  /// @param rows    column indices of each row
  /// @param weights aligned with rows.items; each row sums to 1
  /// @param what    name for messages, e.g. "skinning weights"
  /// @throws Error for an empty row, a column out of range, or a row that does not sum to 1 within 1e-5
  SparseRows(const IndexRows& rows, const std::vector<double>& weights, int64_t columns, const std::string& what);

  int64_t num_rows = 0, num_columns = 0;
  // Compressed rows and their transpose, for kernels.
  torch::Tensor offsets, items, weights;                                   ///< int32 [rows+1], int32 [E], float32 [E]
  torch::Tensor transposed_offsets, transposed_items, transposed_weights;  ///< int32 [cols+1], int32 [E], float32 [E]
  // For references: every row padded to the longest with weight 0 (on its first column).
  torch::Tensor padded_items;    ///< int64 [rows,P]
  torch::Tensor padded_weights;  ///< float64 [rows,P]
};

/// Transforms blended by the weights, in plain tensor operations: sum_k w_ik X_k.
/// @param transforms [B,columns,3,4] @return [B,rows,3,4]
torch::Tensor blend_transforms(const torch::Tensor& transforms, const SparseRows& weights);

}  // namespace doppel
