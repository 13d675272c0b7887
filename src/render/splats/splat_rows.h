#pragma once

#include <torch/types.h>

#include "doppel/render/splats/splat_types.h"

namespace doppel {

/// The numbers of a Gaussian in a row: centre x y z (world, metres); unit quaternion w x y z; three standard deviations
/// along the rotated axes (metres); opacity at the centre, 0 to 1; red, green, blue (display values, 0 and more).
inline constexpr std::int64_t kSplatColumns = 14;

/// Gaussians as rows, for exported actors and their hosts. The colours are those that the camera sees, and a Gaussian
/// that is hidden from it by its normal has the opacity 0. Plain tensor operations.
/// @param projection [B,3,4] pixels from world metres
/// @return [B,N,14] @throws UsageError for wrong shapes or types
torch::Tensor splat_rows(const Splats& splats, const torch::Tensor& projection);

/// The Gaussians of rows, for `draw_splats`: the reverse of `splat_rows`, of degree 0. An opacity becomes 1e-6
/// to 1 - 1e-6, so that its logit is finite; a standard deviation becomes at least 1e-12 m. @param rows [B,N,14]
/// @throws UsageError for another shape or type
Splats splats_of_rows(const torch::Tensor& rows);

}  // namespace doppel
