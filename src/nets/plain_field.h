#pragma once

/// A neural radiance field without a mesh, as in the original (6.12.2): of one frame, sampled all over a box, coarsely
/// and then where something is. What the guided field is compared with.

#include <torch/torch.h>

#include <optional>

#include "doppel/core/config.h"
#include "doppel/nets/field_view.h"
#include "doppel/nets/radiance_field.h"

namespace doppel {

struct PlainFieldConfig {
  RadianceFieldConfig field;  ///< layers and widths of both networks; they see the encoded place instead of features
  int position_octaves = 10;
  int64_t coarse = 64;  ///< samples of the first network
  int64_t fine = 128;   ///< more of the second
  double margin = 0.1;  ///< metres that the box reaches beyond the mesh

  /// Keys: those above; `field` is a section. @throws FileError at the key
  static PlainFieldConfig read(const ConfigReader& reader);
};

/// The rays' parts within the box, and what both networks see there.
struct PlainRays {
  RenderedRays coarse, fine;
  RaySamples coarse_samples, fine_samples;
};

class PlainFieldImpl : public torch::nn::Module {
 public:
  /// @param vertices [N,3] of the mesh in the one frame: they give the box
  /// @param generator draws the initial weights; by default a fresh one with a fixed seed
  PlainFieldImpl(const torch::Tensor& vertices, const PlainFieldConfig& config,
                 std::optional<at::Generator> generator = std::nullopt);

  /// @param origin [3] or [R,3], direction [R,3] unit @param generator places the samples; without one they lie in the
  /// middles. Rays beside the box are empty.
  PlainRays render(const torch::Tensor& origin, const torch::Tensor& direction,
                   std::optional<at::Generator> generator = std::nullopt);
  /// What a camera sees, without gradients, every ray through the box. @param projection [3,4]
  FieldImage draw(const torch::Tensor& projection, int64_t height, int64_t width);

  const PlainFieldConfig& config() const { return config_; }

 private:
  /// The parts of rays within the box; both 0 for those beside it.
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
