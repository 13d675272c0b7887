#pragma once

/// Rotations about the coordinate axes (0 x, 1 y, 2 z) as tensors, in plain operations that a torch::jit trace can
/// hold.

#include <torch/types.h>

#include <array>

namespace doppel {

/// Rotations by angles [...] about one axis: [...,3,3].
torch::Tensor axis_rotation(const torch::Tensor& angle, int axis);

/// [...,3] angles -> [...,3,3] = R(axes[0]) R(axes[1]) R(axes[2]), the outermost first.
torch::Tensor angles_to_rotation(const torch::Tensor& angles, const std::array<int, 3>& axes);

/// The inverse for three different axes. The middle angle lies in [-pi/2, pi/2]. If it is within 1e-6 of the pole, the
/// outermost angle is set to 0. Gradients are finite everywhere.
torch::Tensor rotation_to_angles(const torch::Tensor& rotation, const std::array<int, 3>& axes);

}  // namespace doppel
