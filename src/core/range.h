#pragma once

#include <optional>

namespace doppel {

/// The allowed values of a number: a closed interval. The default allows all finite values.
template <typename T>
struct Range {
  std::optional<T> minimum, maximum;
};
template <typename T>
Range<T> at_least(T minimum) {
  return {minimum, std::nullopt};
}
template <typename T>
Range<T> between(T minimum, T maximum) {
  return {minimum, maximum};
}

}  // namespace doppel
