#pragma once

/// Global alignment: the translation that moves posed landmarks onto the rays of their keypoints.
///
///   t = argmin sum over c,m of sigma_cm |(p_m + t - o_c) x d_cm|^2                  Equation: 5.2
///     = A^-1 b,  A = sum sigma_cm Q_cm,  b = sum sigma_cm Q_cm (o_c - p_m),  Q_cm = I - d_cm d_cm^T
///
/// The printed closed form 5.4 lacks a bracket and the confidences. This layer computes the minimum of 5.2.
/// Letters: B batch, C cameras, M landmarks. World metres.

#include <torch/types.h>

namespace doppel {

/// Rays from cameras through keypoints. They are constants without gradient.
struct LandmarkRays {
  torch::Tensor origin;      ///< float64 [B,C,3] camera centres
  torch::Tensor direction;   ///< float64 [B,C,M,3] unit vectors
  torch::Tensor confidence;  ///< float64 [B,C,M], sigma; 0: not detected
};

/// The rays of keypoints (5.3). A keypoint that is not finite has confidence 0.
/// @param keypoints [B,C,M,3] x, y in pixels of the undistorted image, confidence
/// @param projection [B,C,3,4] pixels of the undistorted image from world metres
/// @param centre [B,C,3] camera centres
/// @throws UsageError naming the argument, with the shape found
LandmarkRays keypoint_rays(const torch::Tensor& keypoints, const torch::Tensor& projection,
                           const torch::Tensor& centre);

struct GlobalAlignmentOptions {
  double confidence_threshold = 0.4;  ///< keypoints below it do not count
  bool binary = false;                ///< the other keypoints have weight 1 instead of their confidence
  /// Weight of the prior for a degenerate sample, relative to trace(A)/3. Valid samples have no prior.
  double damping = 1e-6;
  double largest_condition = 1e6;  ///< of A in the Frobenius norm; a sample above it is degenerate
};

struct GlobalAlignment {
  torch::Tensor translation;  ///< [B,3] in the type of the landmarks; always finite
  /// bool [B]. False: fewer than two rays count, the rays are (nearly) parallel, or a landmark is not finite. The
  /// translation is then the position on the rays nearest to the prior (the prior itself without rays), and has no
  /// gradient.
  torch::Tensor valid;
};

/// @param points [B,M,3] landmarks in world axes, up to the translation
/// @param prior [B,3] the assumed translation where the rays do not determine it, e.g. that of the previous frame;
///   undefined: the origin
/// Gradient: exact, to `points`: dt/dp_m = -A^-1 sum over c of sigma_cm Q_cm, whose sum over m is -I.
/// float32 on the CPU runs loops in double; everything else, and a ReferenceScope, runs the reference.
/// @throws UsageError naming the argument, with the shape found
GlobalAlignment global_alignment(const torch::Tensor& points, const LandmarkRays& rays, const torch::Tensor& prior = {},
                                 const GlobalAlignmentOptions& options = {});
/// The same in plain tensor operations: any device and float type, traceable.
GlobalAlignment global_alignment_reference(const torch::Tensor& points, const LandmarkRays& rays,
                                           const torch::Tensor& prior = {}, const GlobalAlignmentOptions& options = {});

}  // namespace doppel
