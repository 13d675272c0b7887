#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "doppel/core/as_size.h"

namespace doppel {

/// The value below which `share` of the values lie; 0 without values.
inline double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  const std::size_t index = std::min(values.size() - 1, as_size(share * static_cast<double>(values.size())));
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(index), values.end());
  return values[index];
}

inline double mean_of(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return values.empty() ? 0.0 : sum / static_cast<double>(values.size());
}

}  // namespace doppel
