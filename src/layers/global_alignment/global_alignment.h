#pragma once

/// Global alignment: the translation that brings posed landmarks onto the rays of their 2D detections.
///
///   t = argmin sum over c,m of sigma_cm |(p_m + t - o_c) x d_cm|^2                  Equation: 5.2
///     = A^-1 b,  A = sum sigma_cm Q_cm,  b = sum sigma_cm Q_cm (o_c - p_m),  Q_cm = I - d_cm d_cm^T
///
/// The closed form 5.4 as printed lacks a bracket and the confidences; this is the minimum of 5.2.
/// Letters: B batch, C cameras, M landmarks. World metres.

#include <torch/torch.h>

namespace doppel {

/// Rays from cameras through detections. Constants: no gradient goes to them.
struct LandmarkRays {
  torch::Tensor origin;      ///< float64 [B,C,3] camera centres
  torch::Tensor direction;   ///< float64 [B,C,M,3] unit vectors
  torch::Tensor confidence;  ///< float64 [B,C,M], sigma; 0: not seen
};

/// The rays of 2D detections (5.3). What is not finite gets confidence 0.
/// @param keypoints [B,C,M,3] x, y in pixels of the undistorted image, confidence
/// @param projection [B,C,3,4] those pixels from world metres @param centre [B,C,3] of the cameras
/// @throws UsageError naming the argument, with the shape found
LandmarkRays keypoint_rays(const torch::Tensor& keypoints, const torch::Tensor& projection,
                           const torch::Tensor& centre);

struct GlobalAlignmentOptions {
  double confidence_threshold = 0.4;  ///< detections below do not count
  bool binary = false;                ///< the others count 1 each instead of their confidence
  /// Share of trace(A)/3 by which a degenerate sample is pulled to its prior; samples that are valid are not.
  double damping = 1e-6;
  double largest_condition = 1e6;  ///< of A, Frobenius norm; a sample above is degenerate
};

struct GlobalAlignment {
  torch::Tensor translation;  ///< [B,3] in the type of the landmarks; always finite
  /// bool [B]. False: fewer than two rays count, they are (nearly) parallel, or a landmark is not finite. The
  /// translation is then the place on the rays nearest the prior (the prior itself without rays), and has no gradient.
  torch::Tensor valid;
};

/// @param points [B,M,3] landmarks in world axes, up to the translation
/// @param prior [B,3] where a person is assumed when the rays do not tell, e.g. the frame before; undefined: the origin
/// Gradient: exact, to `points`: dt/dp_m = -A^-1 sum over c of sigma_cm Q_cm, whose sum over m is -I.
/// float32 on the CPU takes loops in double, everything else, and a ReferenceScope, the reference.
/// @throws UsageError naming the argument, with the shape found
GlobalAlignment global_alignment(const torch::Tensor& points, const LandmarkRays& rays, const torch::Tensor& prior = {},
                                 const GlobalAlignmentOptions& options = {});
/// The same in plain tensor operations: any device and float type, traceable.
GlobalAlignment global_alignment_reference(const torch::Tensor& points, const LandmarkRays& rays,
                                           const torch::Tensor& prior = {}, const GlobalAlignmentOptions& options = {});

}  // namespace doppel
