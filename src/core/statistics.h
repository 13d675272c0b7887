#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

namespace doppel {

/// The value below which a share of the values lies; 0 without values. @param share 0..1
inline double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  const double last = static_cast<double>(values.size() - 1);
  const auto index =
      static_cast<std::ptrdiff_t>(std::min(last, std::floor(share * static_cast<double>(values.size()))));
  std::nth_element(values.begin(), values.begin() + index, values.end());
  return values[static_cast<std::size_t>(index)];
}

/// The middle value, the upper one of two; 0 without values.
inline double median(std::vector<double> values) { return quantile(std::move(values), 0.5); }

/// 0 without values.
inline double mean_of(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return values.empty() ? 0.0 : sum / static_cast<double>(values.size());
}

}  // namespace doppel
