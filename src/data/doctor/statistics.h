#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "doppel/core/statistics.h"

namespace doppel {

/// The standard deviation of a normal distribution with the same median absolute deviation.
inline double robust_spread(std::vector<double> values) {
  const double middle = median(values);
  for (double& value : values) value = std::abs(value - middle);
  return 1.4826 * median(values);
}

/// A camera's value against those of the other cameras.
struct AgainstOthers {
  double difference = 0.0;  ///< from the median of the others
  double spread = 0.0;      ///< of the others: robust_spread; of up to four, at least a third of their range
  int others = 0;
};
/// @param values [C], NaN: none
inline AgainstOthers against_others(const std::vector<double>& values, std::size_t camera) {
  std::vector<double> others;
  for (std::size_t c = 0; c < values.size(); ++c)
    if (c != camera && std::isfinite(values[c])) others.push_back(values[c]);
  if (others.empty() || !std::isfinite(values[camera])) return {};
  double spread = robust_spread(others);
  const auto [low, high] = std::minmax_element(others.begin(), others.end());
  if (others.size() <= 4) spread = std::max(spread, (*high - *low) / 3.0);
  return {values[camera] - median(others), spread, static_cast<int>(others.size())};
}

}  // namespace doppel
