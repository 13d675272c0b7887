#pragma once

#include <algorithm>
#include <cmath>

namespace doppel {

/// Linear intensity 0..1 as the sRGB value of images (IEC 61966-2-1). glTF and FBX have linear colours.
inline double srgb(double linear) {
  const double x = std::clamp(linear, 0.0, 1.0);
  return x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1 / 2.4) - 0.055;
}

/// The reverse.
inline double linear_of_srgb(double encoded) {
  const double x = std::clamp(encoded, 0.0, 1.0);
  return x <= 0.04045 ? x / 12.92 : std::pow((x + 0.055) / 1.055, 2.4);
}

}  // namespace doppel
