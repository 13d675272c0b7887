#pragma once

#include <torch/types.h>

namespace doppel {

/// Pose prior: squared distance of joint angles from their limits, 0 within them; sum over DoFs, mean over the batch.
/// Equations: 5.7, 5.8
/// @param theta [B,P] @param lower, upper [P], infinite where there is no limit (PoseDofs::lower, upper)
/// @return scalar >= 0; gradient to `theta`
/// @throws UsageError naming the argument, with the shape found
torch::Tensor limits_loss(const torch::Tensor& theta, const torch::Tensor& lower, const torch::Tensor& upper);

}  // namespace doppel
