#pragma once

#include <cstddef>
#include <type_traits>

namespace doppel {

/// Converts an index, a count or an enumerator, known not to be negative, to the type that standard containers take.
/// A floating-point number is rounded towards zero.
template <typename Number>
constexpr std::size_t as_size(Number value) {
  static_assert(std::is_arithmetic_v<Number> || std::is_enum_v<Number>);
  return static_cast<std::size_t>(value);
}

}  // namespace doppel
