#pragma once

/// The radiance field around the mesh (6.25): density and colour of a point in space from the motion features at the
/// closest surface point, the distance to this point, and the viewing direction.
///
///   f_nf(b(V, x, features), gamma(d(V, x)), gamma(direction)) = (c, sigma)
///
/// Features are interpolated linearly between vertices, so the thesis's field resolves no detail finer than the mesh.
/// With `place_octaves`, vertices also carry their positions in the rest pose, and gamma(rest position of the closest
/// point) is an input: the field then represents finer detail that is fixed to the surface.
///
/// Few cameras do not determine how colours change with the viewing direction. The view branch then learns each
/// camera's white balance, and new views get a wrong tint. `view_dependent: false` removes the direction from the
/// inputs.
///
/// Letters: P points, H values per vertex (features, and 3 of the rest position), N vertices, R rays, K samples per
/// ray. Metres.

#include <torch/nn/module.h>
#include <torch/nn/modules/container/modulelist.h>
#include <torch/nn/modules/linear.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include <optional>

#include "doppel/core/options.h"
#include "doppel/layers/closest_point/closest_point.h"
#include "doppel/layers/dense_layers/dense_layers.h"
#include "doppel/layers/volume_rendering/volume_rendering.h"

namespace doppel {

struct RadianceFieldConfig {
  int features = 64;  ///< of the motion
  int layers = 4;     ///< of the trunk
  int width = 256;    ///< of the trunk
  /// The inputs join the hidden values after this layer of the trunk, counted from 1; 0: nowhere. Only for fields that
  /// are not drawn by `image_layers`.
  int skip = 0;
  int view_width = 128;        ///< of the branch with the viewing direction
  int distance_octaves = 10;   ///< of gamma(d)
  bool view_dependent = true;  ///< false: colours do not depend on the viewing direction
  int direction_octaves = 4;   ///< of gamma(direction)
  int place_octaves = 0;       ///< of gamma(rest position); 0: no rest position, as in the thesis
  double density_unit = 0.01;  ///< metres: density = softplus(.) / density_unit
  double t_mi = 0.04;          ///< metres by which d is normalised inside the mesh
  double t_ma = 0.04;          ///< the same outside
  double margin = 0.01;        ///< metres beyond t_mi and t_ma; farther off the density is 0

  int vertex_values() const { return features + (place_octaves > 0 ? 3 : 0); }  ///< H

  /// @throws UsageError listing every fault
  void check() const;
};
void describe_keys(const Keys& keys, RadianceFieldConfig& config);
/// The keys of the layers alone, for a field with other inputs.
void describe_field_layers(const Keys& keys, RadianceFieldConfig& config);

/// gamma: x, then sin and cos of 2^k pi x for k = 0 .. octaves-1. @param x [...,C] @return [..., C (1 + 2 octaves)]
torch::Tensor positional_encoding(const torch::Tensor& x, int octaves);

/// Density and colour of points in space.
struct FieldValues {
  torch::Tensor density;  ///< [P] per metre, >= 0
  torch::Tensor colour;   ///< [P,3] RGB 0..1
};

class RadianceFieldImpl : public torch::nn::Module {
 public:
  /// @param generator draws the initial weights; by default a fresh one with a fixed seed
  explicit RadianceFieldImpl(const RadianceFieldConfig& config, std::optional<at::Generator> generator = std::nullopt);

  /// Plain tensor operations, with gradients to everything.
  /// @param values [P,H] of the closest points @param distance [P] normalised, -1..1 @param direction [P,3] unit,
  /// viewing direction
  /// @throws UsageError naming the argument, with the shape found
  FieldValues forward(const torch::Tensor& values, const torch::Tensor& distance, const torch::Tensor& direction);

  /// The layers of `forward` for images, without tensors, with the weights as they are now. @throws Error with `skip`
  struct ImageLayers {
    DenseLayers trunk;           ///< [num_inputs] to hidden [width]
    std::vector<float> density;  ///< [width] weights
    float density_bias;
    DenseLayers colour;  ///< hidden, followed by the encoded direction if there is one, to the colour's logits
  };
  ImageLayers image_layers() const;

  const RadianceFieldConfig& config() const { return config_; }
  /// The number of inputs: features, the encoded rest position if there is one, and the encoded distance.
  int64_t num_inputs() const;

 private:
  int64_t layer_inputs(int layer) const;
  torch::Tensor density(const torch::Tensor& hidden);
  torch::Tensor colour(const torch::Tensor& hidden, const torch::Tensor& direction);

  RadianceFieldConfig config_;
  torch::nn::ModuleList trunk_{nullptr};
  torch::nn::Linear density_{nullptr}, view_of_hidden_{nullptr}, view_of_direction_{nullptr}, colour_{nullptr};
};
TORCH_MODULE(RadianceField);

/// The surface of a frame with its vertex values.
struct FieldSurface {
  torch::Tensor vertices;  ///< [N,3] world
  torch::Tensor values;    ///< [N,H]: motion features, and rest positions if the field uses them
};

/// Renders rays through the field with gradients, for training. The gradients reach the field's weights, the features,
/// the samples and the vertices (through distance, interpolation of the features, and samples).
/// @param origin [3] or [R,3], direction [R,3] unit
RenderedRays render_field(RadianceField& field, const ClosestPoint& closest, const FieldSurface& surface,
                          const torch::Tensor& origin, const torch::Tensor& direction, const RaySamples& samples);

struct FieldImageOptions {
  int64_t samples = 64;
  int64_t rays_at_once = 48;  ///< of a thread; with the default widths, 48 rays of 64 samples use 7 MB
  /// Colours are not computed for samples with a lower weight. The error of a ray's colour is less than K times this
  /// value.
  double least_weight = 1e-5;
  /// One of this many samples is evaluated first, from the camera on until the ray is opaque. The others are evaluated
  /// only between two of which one is not empty, and only until the ray is opaque; elsewhere the density is 0. 1: all
  /// samples are evaluated, as they are when there are fewer than four of these.
  int64_t first_pass = 4;
  double empty = 1e-3;   ///< optical depth (about alpha) of `first_pass` cells below which a sample is empty
  double opaque = 1e-4;  ///< transmittance below which a ray has ended
};

/// The results of rays, without the weights of the samples.
struct FieldPixels {
  torch::Tensor colour;   ///< [R,3] RGB 0..1 over black
  torch::Tensor opacity;  ///< [R] 0..1
  torch::Tensor depth;    ///< [R] metres along the ray; `near` where the opacity is below 1e-6
};

/// The same without gradients, for images. Each thread draws a few rays at a time, so that their values stay in the
/// cache. Samples outside the shell around the mesh skip the network, as do those in empty space and behind opaque ones
/// (FieldImageOptions). Samples that are not visible skip the colours. float32 on the CPU; the result has the same bits
/// for any number of threads and any `rays_at_once`.
/// @param near, far [R] as RaySamples; samples are at the centres of their intervals
/// @throws UsageError naming the argument, with the shape found
FieldPixels draw_field(RadianceField& field, const ClosestPoint& closest, const FieldSurface& surface,
                       const torch::Tensor& origin, const torch::Tensor& direction, const torch::Tensor& near,
                       const torch::Tensor& far, const FieldImageOptions& options = {});

}  // namespace doppel
