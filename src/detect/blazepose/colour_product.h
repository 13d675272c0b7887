#pragma once

namespace doppel {

/// The sum of blue, green and red. @tparam Colour a vector of floats that begins with these
template <typename Colour>
float brightness(const Colour& colour) {
  return colour[0] + colour[1] + colour[2];
}

/// The inner product of two differences of colours, in which brightness counts 0.4 of other differences, because
/// shadows change it. @tparam Colour as `brightness`
template <typename Colour>
float colour_product(const Colour& a, const Colour& b) {
  constexpr float kBrightnessWeight = 0.15f;  // 0.4 squared
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] - (1.0f - kBrightnessWeight) / 3.0f * brightness(a) * brightness(b);
}

}  // namespace doppel
