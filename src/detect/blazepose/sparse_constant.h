#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "doppel/detect/blazepose/network_model.h"

namespace doppel {

/// A sparse constant: the first axes are dense, in the last axis only some elements of each row are stored.
struct SparseRows {
  std::vector<std::int64_t> row_begin;  ///< [rows + 1] where the elements of each row begin
  std::vector<std::int64_t> column;     ///< [stored] the position of each element in its row
};

/// The dense constant: `stored` at its positions, zeros elsewhere.
/// @param shape at least one axis; rows = the product of all axes but the last
/// @return nothing when the rows do not ascend from 0 to the number of stored elements, or the columns of a row
/// do not ascend inside the last axis
std::optional<std::vector<float>> expand_rows(const SparseRows& rows, const std::vector<float>& stored,
                                              const TensorShape& shape);

}  // namespace doppel
