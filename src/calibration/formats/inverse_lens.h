#pragma once

/// Lenses that a file describes from the image with distortion to the one without.

#include <Eigen/Core>
#include <array>
#include <functional>
#include <optional>

#include "doppel/geometry/camera.h"

namespace doppel {

/// A lens of the kind Lens::opencv that was fitted to the inverse of another one.
struct InverseLens {
  std::array<double, 12> coefficients{};  ///< k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4; the prism s is 0 where not needed
  double largest_residual_px = 0;         ///< over the image
};

/// Fits by least squares over the image. @param undistorted takes an image point at depth 1 with distortion to the one
/// without. @param camera its K and size are used
/// @return nothing when `undistorted` folds the image or yields no finite points
std::optional<InverseLens> fit_inverse_lens(const std::function<Eigen::Vector2d(const Eigen::Vector2d&)>& undistorted,
                                            const Camera& camera);

}  // namespace doppel
