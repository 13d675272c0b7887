#pragma once

#include <torch/types.h>

namespace doppel {

/// Gaussians in space, with the raw values that files of 3D Gaussian splatting hold. S = (degree + 1)^2 spherical
/// harmonics, degree 0 to 3.
struct Splats {
  torch::Tensor positions;   ///< [B,N,3] centres, world, metres
  torch::Tensor rotations;   ///< [B,N,4] quaternions w x y z, normalised by `draw_splats`
  torch::Tensor log_scales;  ///< [B,N,3] natural logarithms of standard deviations in metres, along the rotated axes
  torch::Tensor opacities;   ///< [B,N] logits: the opacity at the centre is sigmoid(x)
  torch::Tensor harmonics;   ///< [B,N,S,3] coefficients of red, green and blue
  /// [B,N,3] world; a Gaussian whose normal points away from a camera is not drawn there. Undefined: all are drawn.
  torch::Tensor normals;
};

/// Y_0, the harmonic of degree 0: the colour of Gaussians of degree 0 is 1/2 + kFirstHarmonic * h.
constexpr double kFirstHarmonic = 0.28209479177387814;

struct SplatOptions {
  float z_near = 0.01f;        ///< metres; Gaussians whose centres are nearer to the camera plane are not drawn
  bool depth = false;          ///< draw SplatImage::depth too
  bool use_reference = false;  ///< plain tensor operations also for float32
};

struct SplatImage {
  torch::Tensor colour;  ///< [B,C,H,W,3] over black: add (1 - alpha) * background
  torch::Tensor alpha;   ///< [B,C,H,W] 0 to 1
  torch::Tensor depth;   ///< [B,C,H,W] sum of weight * metres along the camera's z axis; undefined unless asked for
};

}  // namespace doppel
