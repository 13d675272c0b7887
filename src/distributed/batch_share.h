#pragma once

#include <torch/types.h>

#include <cstdint>

namespace doppel {

/// The rows of a batch that one rank works on: rows first .. first + count - 1 of `whole`. The default is a batch that
/// is not shared. Letters: n ranks, r this rank.
struct BatchShare {
  std::int64_t first = 0, count = 0, whole = 0;

  /// The rows r * whole / n .. (r + 1) * whole / n - 1: the ranks differ by one row at most.
  static BatchShare of(int rank, int world, std::int64_t whole) {
    const std::int64_t first = rank * whole / world;
    return {first, (rank + 1) * whole / world - first, whole};
  }

  bool is_part() const { return count != whole; }
  /// The sizes of the whole batch for a tensor with this rank's rows.
  std::vector<std::int64_t> whole_sizes(torch::IntArrayRef sizes) const {
    std::vector<std::int64_t> all = sizes.vec();
    if (is_part()) all.at(0) = whole;
    return all;
  }
  /// This rank's rows of a tensor with the whole batch. Random numbers are drawn for the whole batch and then cut, so
  /// that n ranks draw what one rank draws.
  torch::Tensor rows(const torch::Tensor& of_whole) const {
    return is_part() ? of_whole.narrow(0, first, count) : of_whole;
  }
};

}  // namespace doppel
