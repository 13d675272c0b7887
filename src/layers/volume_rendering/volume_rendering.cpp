#include "doppel/layers/volume_rendering/volume_rendering.h"

#include <algorithm>
#include <cmath>

#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"

namespace doppel {

using torch::Tensor;

namespace {

/// Optical depth above which a cell is opaque: exp(-60) is negligible beside 1, even in double.
constexpr double kOpaque = 60.0;
constexpr double kMaxDensity = 1e12;  // makes its product with a length finite
constexpr double kMinShare = 1e-5;    // added to the weight of every cell, so that no cell is excluded
constexpr double kFaint = 1e-6;       // opacity below which a depth is undefined

struct Absorption {
  Tensor weights;  ///< [R,K]
  Tensor opacity;  ///< [R]
};

Absorption absorb(const Tensor& density, const RaySamples& samples) {
  check_shape("render_volume", "density", density, {-1, -1}, "[R,K]");
  const int64_t R = density.size(0), K = density.size(1);
  check_shape("render_volume", "samples.t", samples.t, {R, K}, "[R,K]");
  check_shape("render_volume", "samples.near", samples.near, {R}, "[R]");
  check_shape("render_volume", "samples.far", samples.far, {R}, "[R]");
  const Tensor bounded = torch::nan_to_num(density, 0.0, kMaxDensity, 0.0).clamp(0.0, kMaxDensity);
  const Tensor optical = (bounded * samples.step()).clamp_max(kOpaque);
  const Tensor sum = optical.cumsum(1);
  const Tensor before = torch::cat({torch::zeros_like(sum.narrow(1, 0, 1)), sum.narrow(1, 0, K - 1)}, 1);
  return {torch::exp(-before) * -torch::expm1(-optical), -torch::expm1(-sum.select(1, K - 1))};
}

}  // namespace

Tensor RaySamples::step() const {
  if (lengths.defined()) return lengths;
  return ((far - near) / static_cast<double>(t.size(1))).clamp_min(0).unsqueeze(1);
}

Tensor RaySamples::points(const Tensor& origin, const Tensor& direction) const {
  return origin.unsqueeze(-2) + t.unsqueeze(-1) * direction.unsqueeze(-2);
}

namespace {

/// Uniform numbers for the rays of one rank, [R,K] in the type of `like`.
Tensor uniform(const BatchShare& share, int64_t rays, int64_t samples, const at::Generator& generator,
               const Tensor& like) {
  return share.rows(torch::rand(share.whole_sizes({rays, samples}), generator, torch::kFloat32)).to(like.options());
}

}  // namespace

RaySamples sample_cells(const Tensor& near, const Tensor& far, int64_t samples, std::optional<at::Generator> generator,
                        const BatchShare& share) {
  check_shape("sample_cells", "near", near, {-1}, "[R]");
  check_shape("sample_cells", "far", far, {near.size(0)}, "[R]");
  check_same_kind("sample_cells", "far", far, near);
  if (samples < 1) fail<UsageError>("sample_cells: {} samples per ray; there must be at least 1", samples);
  Tensor position = torch::full({near.size(0), samples}, 0.5, near.options());
  if (generator) position = uniform(share, near.size(0), samples, *generator, near);
  const Tensor cell = (torch::arange(samples, near.options()) + position) / static_cast<double>(samples);
  return {near, far, near.unsqueeze(1) + cell * (far - near).unsqueeze(1), {}};
}

RaySamples sample_by_weight(const RaySamples& coarse, const Tensor& weights, int64_t count,
                            std::optional<at::Generator> generator, const BatchShare& of_batch) {
  const torch::NoGradGuard no_grad;
  const int64_t R = coarse.t.size(0), K = coarse.t.size(1);
  check_shape("sample_by_weight", "weights", weights, {R, K}, "[R,K]");
  if (count < 1) fail<UsageError>("sample_by_weight: {} samples per ray; there must be at least 1", count);
  const Tensor share = weights.to(coarse.t.options()) + kMinShare;
  const Tensor sum = (share / share.sum(1, true)).cumsum(1).contiguous();
  Tensor quantile = torch::full({R, count}, 0.5, coarse.t.options());
  if (generator) quantile = uniform(of_batch, R, count, *generator, coarse.t);
  quantile = ((torch::arange(count, coarse.t.options()) + quantile) / static_cast<double>(count)).contiguous();
  const Tensor cell = torch::searchsorted(sum, quantile).clamp_max(K - 1);
  const Tensor above = sum.gather(1, cell), below = above - (share / share.sum(1, true)).gather(1, cell);
  const Tensor within = ((quantile - below) / (above - below).clamp_min(1e-12)).clamp(0.0, 1.0);
  const Tensor length = (coarse.far - coarse.near).clamp_min(0).unsqueeze(1);
  const Tensor drawn = coarse.near.unsqueeze(1) + (cell + within) * length / static_cast<double>(K);
  RaySamples fine{coarse.near, coarse.far, std::get<0>(torch::cat({coarse.t, drawn}, 1).sort(1)), {}};
  const int64_t all = K + count;
  const Tensor halves = 0.5 * (fine.t.narrow(1, 0, all - 1) + fine.t.narrow(1, 1, all - 1));
  const Tensor borders = torch::cat({fine.near.unsqueeze(1), halves, torch::max(fine.far, fine.near).unsqueeze(1)}, 1);
  fine.lengths = (borders.narrow(1, 1, all) - borders.narrow(1, 0, all)).clamp_min(0);
  return fine;
}

RaySums render_ray(const float* density, const float* t, int64_t samples, float near, float far, float* weights) {
  const double length = std::max(0.0, static_cast<double>(far) - near), cell = length / static_cast<double>(samples);
  double before = 0.0, sum = 0.0, position = 0.0;
  for (int64_t k = 0; k < samples; ++k) {
    const double bounded = density[k] > 0.0f ? std::min<double>(density[k], kMaxDensity) : 0.0;  // NaN is 0
    const double optical = std::min(bounded * cell, kOpaque);
    const double weight = optical > 0.0 ? std::exp(-before) * -std::expm1(-optical) : 0.0;
    weights[k] = static_cast<float>(weight);
    before += optical;
    sum += weight;
    position += weight * (t[k] - near);
  }
  return {static_cast<float>(-std::expm1(-before)), sum > kFaint ? static_cast<float>(near + position / sum) : near};
}

RenderedRays render_volume(const Tensor& density, const Tensor& colour, const RaySamples& samples) {
  const Absorption seen = absorb(density, samples);
  check_shape("render_volume", "colour", colour, {density.size(0), density.size(1), -1}, "[R,K,C]");
  check_same_kind("render_volume", "colour", colour, density);
  RenderedRays result;
  result.weights = seen.weights;
  result.opacity = seen.opacity;
  result.colour = (seen.weights.unsqueeze(-1) * torch::nan_to_num(colour)).sum(1);
  // Positions relative to the interval, so that neither the camera distance nor the unit costs digits.
  const Tensor length = samples.far - samples.near;
  const Tensor position =
      (samples.t - samples.near.unsqueeze(1)) / torch::where(length > 0, length, torch::ones_like(length)).unsqueeze(1);
  const Tensor sum = seen.weights.sum(1, true), solid = sum > kFaint;
  const Tensor share =
      torch::where(solid, seen.weights, torch::zeros_like(position)) / torch::where(solid, sum, torch::ones_like(sum));
  const Tensor mean = (share * position).sum(1, true);
  result.variance = (share * (position - mean).square()).sum(1);
  result.depth = samples.near + mean.squeeze(1) * length;
  return result;
}

}  // namespace doppel
