#pragma once

/// Volume rendering (6.20 - 6.22): densities and colours at points of a ray to the colour, opacity and depth that a
/// camera sees along it.
///
///   alpha_i = 1 - exp(-delta sigma_i),   T_i = exp(-sum over j < i of delta sigma_j),   w_i = T_i alpha_i
///
/// delta is the length of a sample's cell, for the last sample, too. Letters: R rays, K samples of a ray. Metres along
/// unit directions, from the camera.
///
/// Plain tensor operations, any device and float type, no kernel: at R = 1000 and K = 64 they take a small part of what
/// the field's network does: some 20 passes over 64,000 numbers, against 0.25 million products for each of them.

#include <torch/torch.h>

#include <optional>

namespace doppel {

/// One point in each of the K cells of [near, far].
struct RaySamples {
  torch::Tensor near, far;  ///< [R]; near = far: the ray is empty
  torch::Tensor t;          ///< [R,K], ascending
  torch::Tensor lengths{};  ///< [R,K] of the cells; undefined: all of a ray are equally long

  /// Lengths of the cells [R,1], or [R,K] where they were given; 0 where far is not beyond near.
  torch::Tensor step() const;
  /// @param origin, direction [R,3] (or [3]), the latter of unit length @return [R,K,3] world
  torch::Tensor points(const torch::Tensor& origin, const torch::Tensor& direction) const;
};

/// The samples of 6.24, for any interval.
/// @param near, far [R]; gradients to both
/// @param generator draws a place in each cell; without one it is the middle
/// @throws UsageError naming the argument, with what was found
RaySamples sample_cells(const torch::Tensor& near, const torch::Tensor& far, int64_t samples,
                        std::optional<at::Generator> generator = std::nullopt);

/// Samples where earlier ones found something (importance sampling): `count` more on each ray, drawn by the weights of
/// the cells, and the earlier ones. The cells reach half way to the neighbours.
/// @param coarse of equal cells @param weights [R,K] of volume_weights, no gradient @param generator draws; without one
/// the quantiles are evenly spread
/// @return K + count samples, without gradients
/// @throws UsageError naming the argument, with what was found
RaySamples sample_by_weight(const RaySamples& coarse, const torch::Tensor& weights, int64_t count,
                            std::optional<at::Generator> generator = std::nullopt);

/// What is seen along rays.
struct RenderedRays {
  torch::Tensor colour;  ///< [R,C] sum of w c, over black
  torch::Tensor
      opacity;  ///< [R] sum of w, 0..1: exactly 0 where all densities are 0, exactly 1 where a sample is opaque
  /// [R] metres, sum of w t / sum of w (6.26, which lacks the division and so puts what is not quite opaque too near);
  /// `near` where the opacity is below 1e-6.
  torch::Tensor depth;
  /// [R] of the depth, sum of w (t - depth)^2 / sum of w (6.31), in squares of the interval's length, so within
  /// [0, 1/4]; 0 where the opacity is below 1e-6.
  torch::Tensor variance;
  torch::Tensor weights;  ///< [R,K] w
};

/// @param density [R,K] per metre, >= 0; infinity is opaque; what is negative or no number counts 0
/// @param colour [R,K,C] of the same type
/// Gradients: to density, colour and the samples' near, far, t; finite for any density.
/// @throws UsageError naming the argument, with the shape found
RenderedRays render_volume(const torch::Tensor& density, const torch::Tensor& colour, const RaySamples& samples);

/// Only the weights w [R,K]: what the colours will count, before they are known.
torch::Tensor volume_weights(const torch::Tensor& density, const RaySamples& samples);

}  // namespace doppel
