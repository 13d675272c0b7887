#pragma once

#include <torch/types.h>

namespace doppel {

/// Number of spherical harmonics (bands 0 to 2).
constexpr int kShBasis = 9;

/// The basis without its constants, in this order: 1, y, z, x, xy, yz, 3z^2-1, xz, x^2-y^2 of a unit normal in world
/// axes. The constants are part of the lighting coefficients (sh_constants).
/// Plain tensor operations, differentiable, any dtype. @param normals [...,3] @return [...,9]
/// Equation: 6.12
torch::Tensor sh_basis(const torch::Tensor& normals);

/// The factors that make the basis orthonormal on the sphere, in the same order: ours = constant * orthonormal.
/// @return float64 [9]
torch::Tensor sh_constants();

/// Lighting that leaves the albedo unchanged: 1 for the constant of each channel, 0 otherwise. @return float32 [3,9]
torch::Tensor identity_lighting();

}  // namespace doppel
