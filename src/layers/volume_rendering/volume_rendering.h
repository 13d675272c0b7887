#pragma once

/// Volume rendering (6.20 - 6.22): from densities and colours at points of a ray to the colour, opacity and depth that
/// a camera sees along the ray.
///
///   alpha_i = 1 - exp(-delta sigma_i),   T_i = exp(-sum over j < i of delta sigma_j),   w_i = T_i alpha_i
///
/// delta is the length of a sample's cell, also for the last sample. Letters: R rays, K samples of a ray. Metres along
/// unit directions, from the camera.
///
/// Plain tensor operations, any device and float type. Training needs no kernel, because the cost is small beside the
/// network of the radiance field: at R = 1000 and K = 64 some 20 passes over 64,000 numbers, against 0.25 million
/// products for each of these numbers. Images are drawn ray by ray, without tensors, with `render_ray`.

#include <torch/types.h>

#include <optional>

#include "doppel/distributed/batch_share.h"

namespace doppel {

/// One point in each of the K cells of [near, far].
struct RaySamples {
  torch::Tensor near, far;  ///< [R]; near = far: the ray is empty
  torch::Tensor t;          ///< [R,K], ascending
  torch::Tensor lengths{};  ///< [R,K] of the cells; undefined: all cells of a ray have the same length

  /// Lengths of the cells: [R,K] if `lengths` is defined, otherwise [R,1]; 0 where far is not beyond near.
  torch::Tensor step() const;
  /// @param origin, direction [R,3] (or [3]), the latter of unit length @return [R,K,3] world
  torch::Tensor points(const torch::Tensor& origin, const torch::Tensor& direction) const;
};

/// The samples of 6.24, for any interval.
/// @param near, far [R]; gradients to both
/// @param generator draws a position in each cell; undefined: the middle of the cell
/// @param share the rays of a batch that ranks share
/// @throws UsageError naming the argument, with what was found
RaySamples sample_cells(const torch::Tensor& near, const torch::Tensor& far, int64_t samples,
                        std::optional<at::Generator> generator = std::nullopt, const BatchShare& share = {});

/// Importance sampling: adds `count` samples to each ray, drawn in proportion to the weights of the cells, and keeps
/// the earlier samples. The new cells reach half way to the neighbouring samples.
/// @param coarse samples in equal cells @param weights [R,K] of RenderedRays, no gradient
/// @param generator draws the samples; undefined: evenly spread quantiles
/// @param of_batch the rays of a batch that ranks share
/// @return K + count samples, without gradients
/// @throws UsageError naming the argument, with what was found
RaySamples sample_by_weight(const RaySamples& coarse, const torch::Tensor& weights, int64_t count,
                            std::optional<at::Generator> generator = std::nullopt, const BatchShare& of_batch = {});

/// The colour, opacity and depth along rays.
struct RenderedRays {
  torch::Tensor colour;  ///< [R,C] sum of w c, over black
  torch::Tensor
      opacity;  ///< [R] sum of w, 0..1: exactly 0 where all densities are 0, exactly 1 where a sample is opaque
  /// [R] metres, sum of w t / sum of w; `near` where the opacity is below 1e-6. 6.26 lacks the division, so its depths
  /// are too small where the opacity is below 1.
  torch::Tensor depth;
  /// [R] variance of the depth, sum of w (t - depth)^2 / sum of w (6.31), in squares of the interval's length, hence
  /// within [0, 1/4]; 0 where the opacity is below 1e-6.
  torch::Tensor variance;
  torch::Tensor weights;  ///< [R,K] w
};

/// @param density [R,K] per metre, >= 0; infinity is opaque; negative values and NaN count as 0
/// @param colour [R,K,C] of the same type
/// Gradients: to density, colour and the samples' near, far, t; finite for any density.
/// @throws UsageError naming the argument, with the shape found
RenderedRays render_volume(const torch::Tensor& density, const torch::Tensor& colour, const RaySamples& samples);

/// Opacity and depth of one ray as in RenderedRays.
struct RaySums {
  float opacity;  ///< 0..1
  float depth;    ///< metres
};

/// `render_volume` of one ray with equal cells, without tensors and gradients; the caller sums w c.
/// @param density [K] per metre, as render_volume @param t [K] metres, ascending @param near, far metres
/// @param weights [K] receives w
RaySums render_ray(const float* density, const float* t, int64_t samples, float near, float far, float* weights);

}  // namespace doppel
