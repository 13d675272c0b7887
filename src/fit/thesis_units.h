#pragma once

#include "doppel/energy/evidence.h"

namespace doppel {

/// The weights of the thesis for one camera (4.8) are for millimetres and for pixels of an image 540 wide. Terms count
/// in metres and in reference pixels.
constexpr double kThesisWidth = 540.0;

/// Converts a weight per squared millimetre.
constexpr double per_square_metre(double weight) { return 1e6 * weight; }
/// Converts a weight per squared pixel of the thesis.
constexpr double per_square_reference_pixel(double weight) {
  return weight * (kThesisWidth / kReferenceWidth) * (kThesisWidth / kReferenceWidth);
}
/// Converts a number of pixels of the thesis to reference pixels.
constexpr double reference_from_thesis(double pixels) { return pixels * kReferenceWidth / kThesisWidth; }
inline double thesis_pixels_to_image(const PinholeCamera& camera, double pixels) {
  return pixels * camera.width / kThesisWidth;
}

}  // namespace doppel
