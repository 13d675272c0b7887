#include "doppel/layers/sparse_rows.h"

#include <algorithm>
#include <cmath>

#include "doppel/core/error.h"
#include "doppel/layers/transform_math.h"

namespace doppel {
namespace {

void check_rows(const IndexRows& rows, const std::vector<double>& weights, int64_t columns, const std::string& what) {
  if (rows.items.size() != weights.size()) {
    fail("{}: {} indices but {} weights", what, rows.items.size(), weights.size());
  }
  for (int row = 0; row < rows.num_rows(); ++row) {
    double sum = 0.0;
    for (int e = rows.offsets[row]; e < rows.offsets[row + 1]; ++e) {
      if (rows.items[e] < 0 || rows.items[e] >= columns) {
        fail("{}: row {} names column {}, allowed are 0..{}", what, row, rows.items[e], columns - 1);
      }
      sum += weights[e];
    }
    if (!(std::abs(sum - 1.0) <= 1e-5)) fail("{}: row {} sums to {}, each row must sum to 1", what, row, sum);
  }
}

template <typename T>
torch::Tensor tensor_of(const std::vector<T>& values, torch::ScalarType type) {
  return torch::from_blob(const_cast<T*>(values.data()), {static_cast<int64_t>(values.size())},
                          c10::CppTypeToScalarType<T>::value)
      .to(type, /*non_blocking=*/false, /*copy=*/true);
}

}  // namespace

SparseRows::SparseRows(const IndexRows& rows, const std::vector<double>& row_weights, int64_t columns,
                       const std::string& what)
    : num_rows(rows.num_rows()), num_columns(columns) {
  check_rows(rows, row_weights, columns, what);
  offsets = tensor_of(rows.offsets, torch::kInt32);
  items = tensor_of(rows.items, torch::kInt32);
  weights = tensor_of(row_weights, torch::kFloat32);

  std::vector<int> column_offsets(columns + 1, 0), row_of(rows.items.size());
  std::vector<float> column_weights(rows.items.size());
  for (int column : rows.items) ++column_offsets[column + 1];
  for (int64_t c = 0; c < columns; ++c) column_offsets[c + 1] += column_offsets[c];
  std::vector<int> next(column_offsets.begin(), column_offsets.end() - 1);
  int longest = 0;
  for (int row = 0; row < num_rows; ++row) {
    longest = std::max(longest, rows.size(row));
    for (int e = rows.offsets[row]; e < rows.offsets[row + 1]; ++e) {
      const int position = next[rows.items[e]]++;
      row_of[position] = row;
      column_weights[position] = static_cast<float>(row_weights[e]);
    }
  }
  transposed_offsets = tensor_of(column_offsets, torch::kInt32);
  transposed_items = tensor_of(row_of, torch::kInt32);
  transposed_weights = tensor_of(column_weights, torch::kFloat32);

  padded_items = torch::zeros({num_rows, longest}, torch::kInt64);
  padded_weights = torch::zeros({num_rows, longest}, torch::kFloat64);
  auto* item = padded_items.data_ptr<int64_t>();
  auto* weight = padded_weights.data_ptr<double>();
  for (int row = 0; row < num_rows; ++row) {
    const std::span<const int> items_of_row = rows.row(row);
    for (int p = 0; p < longest; ++p) {
      const bool filled = p < rows.size(row);
      *item++ = items_of_row[filled ? p : 0];
      *weight++ = filled ? row_weights[rows.offsets[row] + p] : 0.0;
    }
  }
}

torch::Tensor blend_transforms(const torch::Tensor& transforms, const SparseRows& weights) {
  const torch::Tensor items = index_like(weights.padded_items, transforms);
  const torch::Tensor weight = constant_like(weights.padded_weights, transforms).unsqueeze(-1).unsqueeze(-1);
  torch::Tensor sum;
  for (int64_t p = 0; p < items.size(1); ++p) {
    const torch::Tensor term = weight.select(1, p) * transforms.index_select(1, items.select(1, p));
    sum = p == 0 ? term : sum + term;
  }
  return sum;
}

}  // namespace doppel
