#pragma once

#include "doppel/track/energy/evidence.h"

namespace doppel {

/// The thesis gives the options of the one-camera tracker (4.8) for millimetres and for pixels of an image 540 wide;
/// its configuration file does too. The options themselves count in metres and reference pixels (image 1024 wide).
constexpr double kThesisWidth = 540.0;

/// Converts a weight per squared millimetre to a weight per squared metre.
constexpr double per_squared_millimetre(double weight) { return 1e6 * weight; }
/// Converts a weight per squared pixel of the thesis to a weight per squared reference pixel.
constexpr double per_squared_thesis_pixel(double weight) {
  return weight * (kThesisWidth / kReferenceWidth) * (kThesisWidth / kReferenceWidth);
}
/// Converts a length in pixels of the thesis to reference pixels.
constexpr double thesis_pixels(double pixels) { return pixels * kReferenceWidth / kThesisWidth; }
/// Converts millimetres to metres.
constexpr double millimetres(double length) { return 1e-3 * length; }

}  // namespace doppel
