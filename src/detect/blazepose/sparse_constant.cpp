#include "doppel/detect/blazepose/sparse_constant.h"

#include "doppel/core/as_size.h"

namespace doppel {

namespace {

bool rows_are_valid(const SparseRows& rows, std::int64_t num_rows, std::int64_t width, std::size_t stored) {
  if (rows.row_begin.size() != as_size(num_rows) + 1 || rows.column.size() != stored) return false;
  if (rows.row_begin.front() != 0 || rows.row_begin.back() != static_cast<std::int64_t>(stored)) return false;
  for (std::size_t row = 0; row + 1 < rows.row_begin.size(); ++row) {
    if (rows.row_begin[row] > rows.row_begin[row + 1]) return false;
  }
  for (const std::int64_t column : rows.column) {
    if (column < 0 || column >= width) return false;
  }
  return true;
}

}  // namespace

std::optional<std::vector<float>> expand_rows(const SparseRows& rows, const std::vector<float>& stored,
                                              const TensorShape& shape) {
  const std::int64_t elements = num_elements(shape), width = shape.back();
  const std::int64_t num_rows = elements / width;
  if (!rows_are_valid(rows, num_rows, width, stored.size())) return std::nullopt;
  std::vector<float> dense(elements, 0.0f);
  for (std::int64_t row = 0; row < num_rows; ++row) {
    std::int64_t before = -1;
    for (std::int64_t i = rows.row_begin[row]; i < rows.row_begin[as_size(row) + 1]; ++i) {
      const std::int64_t column = rows.column[i];
      if (column <= before) return std::nullopt;
      before = column;
      dense[row * width + column] = stored[i];
    }
  }
  return dense;
}

}  // namespace doppel
