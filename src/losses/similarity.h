#pragma once

/// Structural similarity (Wang et al. 2004) as a loss:
///
///   L = 1 - mean over windows, {R,G,B} of
///       (2 m_a m_b + C1) (2 s_ab + C2) / ((m_a^2 + m_b^2 + C1) (s_a^2 + s_b^2 + C2))
///
/// m, s^2 and s_ab are means, variances and the covariance under a Gaussian window of 11 x 11 pixels and standard
/// deviation 1.5, C1 = 0.01^2 and C2 = 0.03^2. Windows that the image's border cuts off do not count. The same as
/// `structural_similarity` of the evaluation, for colours 0..1.

#include <torch/types.h>

namespace doppel {

/// Gradients: to `a`, none to `b`. No second derivative. float32 runs the kernel, which leaves out windows where both
/// images are black, because these are equal; float64 runs the reference.
/// @param a, b [B,C,H,W,3] RGB 0..1, at least 11 x 11 pixels @return scalar 0..2
/// @throws UsageError for another shape or type
torch::Tensor similarity_loss(const torch::Tensor& a, const torch::Tensor& b);
/// The loss in plain tensor operations, with gradients to both images.
torch::Tensor similarity_loss_reference(const torch::Tensor& a, const torch::Tensor& b);

}  // namespace doppel
