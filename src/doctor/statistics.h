#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "doppel/core/as_size.h"

namespace doppel {

/// The value below which a share of the values lies; 0 for no values. @param share 0..1
inline double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  const auto place = static_cast<std::ptrdiff_t>(
      std::min(static_cast<double>(values.size() - 1), std::floor(share * static_cast<double>(values.size()))));
  std::nth_element(values.begin(), values.begin() + place, values.end());
  return values[as_size(place)];
}
/// The middle value; 0 for no values.
inline double median(const std::vector<double>& values) { return quantile(values, 0.5); }

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
