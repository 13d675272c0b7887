#pragma once

#include <cstdint>

namespace doppel {

/// Sum and count of a mean.
struct Mean {
  double sum = 0.0;
  std::int64_t count = 0;
  void add(double value) {
    sum += value;
    ++count;
  }
  /// @pre count > 0
  double value() const { return sum / static_cast<double>(count); }
};

}  // namespace doppel
