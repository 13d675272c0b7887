#pragma once

#include <torch/types.h>

#include "doppel/render/splats/splat_types.h"

namespace doppel {

/// Draws Gaussians (Kerbl et al., 3D Gaussian Splatting for Real-Time Radiance Field Rendering, 2023; EWA splatting).
/// In the order of their distance from the camera, nearest first, the Gaussians i of a pixel d add up to
///
///   colour = sum_i w_i c_i,    w_i = T_i a_i,    T_i = prod_{j<i} (1 - a_j),    alpha = sum_i w_i
///   a_i = min(0.99, o_i exp(-1/2 (d - m_i)^T S_i^-1 (d - m_i))),    S_i = J R diag(s)^2 R^T J^T + 0.3 I
///   c_i = max(0, 1/2 + sum_k h_ik Y_k(direction from the camera's centre to the position))
///
/// m is the projected centre in pixels, J the Jacobian of the projection there (at most 15 % of the image outside of
/// the image, where a linear projection is no longer one). A Gaussian adds nothing to a pixel with a_i < 1/255 or
/// T_i < 1e-4. Y are the real spherical harmonics in the order and with the signs of `view_harmonics`.
///
/// Gradients go to positions, rotations, log_scales, opacities and harmonics. The order, the two thresholds and the
/// limits of J are held fixed. A Gaussian with a value that is not finite, a quaternion shorter than 1e-12 or longer
/// than 1e12, or a centre beyond 2^20 pixels is not drawn and has the gradient 0 (more limits of the kernel:
/// docs/layers/splats.md).
///
/// float32 runs the kernel, which has no second derivative. float64, a torch::jit trace and options.use_reference run
/// the reference, whose memory is N times that of the images. The result has the same bits for any number of threads.
///
/// All tensors are on the CPU and have the type of `positions`.
/// @param projection [B,C,3,4] pixels from world metres, pixel centres at +0.5. A matrix of zeros gives an empty image.
/// @param height, width of the images, 1 to 16384 pixels
/// @throws UsageError for wrong shapes or types, and for a projection without a camera centre
SplatImage draw_splats(const Splats& splats, const torch::Tensor& projection, std::int64_t height, std::int64_t width,
                       const SplatOptions& options = {});

/// @param op begins the message @throws UsageError unless shapes, types and the number of harmonics are those of Splats
void check_splats(const char* op, const Splats& splats);

/// The real spherical harmonics of unit vectors, with the constants of an orthonormal basis and the signs that files of
/// 3D Gaussian splatting assume. Plain tensor operations.
/// @param directions [...,3] @param count 1, 4, 9 or 16 @return [...,count]
torch::Tensor view_harmonics(const torch::Tensor& directions, std::int64_t count);

}  // namespace doppel
