#pragma once

/// A neural radiance field without a mesh, as in the original (6.12.2), for comparison with the guided field. It
/// represents one frame. Rays are sampled in a box, first coarsely and then where the density is high.

#include <torch/nn/module.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include <optional>

#include "doppel/core/options.h"
#include "doppel/nets/field_view.h"
#include "doppel/nets/radiance_field.h"

namespace doppel {

struct PlainFieldConfig {
  /// Layers and widths of both networks; their input is the encoded position. The original has 8 layers of 256 with
  /// `skip` 5 (Mildenhall et al. 2020); the defaults are those of the guided field.
  RadianceFieldConfig field;
  int position_octaves = 10;
  int64_t coarse = 64;  ///< samples of the coarse network
  int64_t fine = 128;   ///< additional samples of the fine network
  double margin = 0.1;  ///< metres between the mesh and the sides of the box
};
void describe_keys(const Keys& keys, PlainFieldConfig& config);

/// The results and the samples of both networks for rays through the box.
struct PlainRays {
  RenderedRays coarse, fine;
  RaySamples coarse_samples, fine_samples;
};

class PlainFieldImpl : public torch::nn::Module {
 public:
  /// @param vertices [N,3] of the mesh in this frame; they define the box
  /// @param generator draws the initial weights; by default a fresh one with a fixed seed
  PlainFieldImpl(const torch::Tensor& vertices, const PlainFieldConfig& config,
                 std::optional<at::Generator> generator = std::nullopt);

  /// Renders rays with both networks. Rays that miss the box are empty.
  /// @param origin [3] or [R,3], direction [R,3] unit
  /// @param generator draws the positions of the samples; without one they are the centres of their intervals
  /// @param share the rays of a batch that ranks share
  PlainRays render(const torch::Tensor& origin, const torch::Tensor& direction,
                   const std::optional<at::Generator>& generator = std::nullopt, const BatchShare& share = {});
  /// The image of a camera, without gradients. @param projection [3,4]
  FieldImage draw(const torch::Tensor& projection, int64_t height, int64_t width);

  const PlainFieldConfig& config() const { return config_; }

 private:
  /// The intervals of rays within the box; both ends 0 for rays that miss the box.
  RayInterval through_box(const torch::Tensor& origin, const torch::Tensor& direction) const;
  FieldValues at(RadianceField& network, const torch::Tensor& points, const torch::Tensor& direction);
  RenderedRays seen(RadianceField& network, const torch::Tensor& origin, const torch::Tensor& direction,
                    const RaySamples& samples);

  PlainFieldConfig config_;
  torch::Tensor centre_, half_size_;  ///< [3] of the box, saved with the model
  RadianceField coarse_{nullptr}, fine_{nullptr};
};
TORCH_MODULE(PlainField);

}  // namespace doppel
