#pragma once

/// The radiance field around the mesh (6.25): density and colour of a point of space from the motion features of the
/// closest point of the surface, the distance from it, and the direction of the look.
///
///   f_nf(b(V, x, features), gamma(d(V, x)), gamma(direction)) = (c, sigma)
///
/// Between vertices features are linear, so what the thesis's field shows is no finer than the mesh. With
/// `place_octaves` vertices also carry their place at rest, and gamma(place of the closest point) is an input: the
/// field then paints on the rest surface with details of its own, whatever the pose.
///
/// A handful of cameras tells nothing about how colours change with the direction: the view branch then learns each
/// camera's white balance and guesses a cast for every new view. `view_dependent: false` leaves the direction out.
///
/// Letters: P points, H values per vertex (features, and 3 of the place), N vertices, R rays, K samples of a ray.
/// Metres.

#include <torch/torch.h>

#include <optional>

#include "doppel/core/config.h"
#include "doppel/layers/closest_point/closest_point.h"
#include "doppel/layers/volume_rendering/volume_rendering.h"

namespace doppel {

struct RadianceFieldConfig {
  int features = 64;           ///< of the motion
  int layers = 4;              ///< of the trunk
  int width = 256;             ///< of the trunk
  int view_width = 128;        ///< of the branch that sees the direction
  int distance_octaves = 10;   ///< of gamma(d)
  bool view_dependent = true;  ///< false: colours are the same from everywhere
  int direction_octaves = 4;   ///< of gamma(direction)
  int place_octaves = 0;       ///< of gamma(place at rest); 0: no place, as in the thesis
  double density_unit = 0.01;  ///< metres: density = softplus(.) / density_unit
  double t_mi = 0.04;          ///< metres that d is normalised by inside the mesh
  double t_ma = 0.04;          ///< the same outside
  double margin = 0.01;  ///< metres beyond t_mi and t_ma up to which there may be density; farther off there is none

  int vertex_values() const { return features + (place_octaves > 0 ? 3 : 0); }  ///< H

  /// Reads the keys above over `defaults`. @throws FileError at the key
  static RadianceFieldConfig read(const ConfigReader& reader, const RadianceFieldConfig& defaults);
  /// @throws UsageError listing every fault
  void check() const;
};

/// gamma: x, then sin and cos of 2^k pi x for k = 0 .. octaves-1. @param x [...,C] @return [..., C (1 + 2 octaves)]
torch::Tensor positional_encoding(const torch::Tensor& x, int octaves);

/// What is at points of space.
struct FieldValues {
  torch::Tensor density;  ///< [P] per metre, >= 0
  torch::Tensor colour;   ///< [P,3] RGB 0..1
};

class RadianceFieldImpl : public torch::nn::Module {
 public:
  /// @param generator draws the initial weights; by default a fresh one with a fixed seed
  explicit RadianceFieldImpl(const RadianceFieldConfig& config, std::optional<at::Generator> generator = std::nullopt);

  /// Plain tensor operations, with gradients to everything.
  /// @param values [P,H] of the closest points @param distance [P] normalised, -1..1 @param direction [P,3] unit, of
  /// the look
  /// @throws UsageError naming the argument, with the shape found
  FieldValues forward(const torch::Tensor& values, const torch::Tensor& distance, const torch::Tensor& direction);

  // The steps of `forward`, for those who do not want all of them for every point.
  torch::Tensor trunk(const torch::Tensor& inputs);  ///< [P,num_inputs] to hidden [P,width]
  torch::Tensor density(const torch::Tensor& hidden);
  /// What the view branch adds for directions [...,3] to that of the hidden values: 0 where colours do not depend on
  /// them. @return [..., view_width]
  torch::Tensor view_term(const torch::Tensor& direction);
  torch::Tensor colour(const torch::Tensor& hidden, const torch::Tensor& view_term);

  const RadianceFieldConfig& config() const { return config_; }
  /// Features, the encoded place if there is one, and the encoded distance.
  int64_t num_inputs() const;

 private:
  RadianceFieldConfig config_;
  torch::nn::ModuleList trunk_{nullptr};
  torch::nn::Linear density_{nullptr}, view_of_hidden_{nullptr}, view_of_direction_{nullptr}, colour_{nullptr};
};
TORCH_MODULE(RadianceField);

/// A frame's surface with what the field needs of it.
struct FieldSurface {
  torch::Tensor vertices;  ///< [N,3] world
  torch::Tensor values;    ///< [N,H]: features of the motion, and places at rest if the field sees them
};

/// Rays through the field with gradients, for training: to the field's weights, the features, the samples and the
/// vertices (by distance, features' place and samples).
/// @param origin [3] or [R,3], direction [R,3] unit
RenderedRays render_field(RadianceField& field, const ClosestPoint& closest, const FieldSurface& surface,
                          const torch::Tensor& origin, const torch::Tensor& direction, const RaySamples& samples);

struct FieldImageOptions {
  int64_t samples = 64;
  int64_t rays_at_once = 128;  ///< 128 rays of 64 samples take about 30 MB, whatever the image's size
  /// Colours are not computed for samples whose weight is below; the colour of a ray is off by less than K times that.
  double least_weight = 1e-5;
};

/// What rays see, without weights of samples.
struct FieldPixels {
  torch::Tensor colour;          ///< [R,3] over black
  torch::Tensor opacity, depth;  ///< [R]
};

/// The same without gradients, for images: rays in chunks of bounded memory, features gathered and encoded in one
/// pass, no network for samples outside the shell around the mesh, no view branch for samples that are not seen.
/// float32 on the CPU; the result does not depend on the size of the chunks beyond rounding.
/// @param near, far [R] as RaySamples; samples stand in the middles of their cells
/// @throws UsageError naming the argument, with the shape found
FieldPixels draw_field(RadianceField& field, const ClosestPoint& closest, const FieldSurface& surface,
                      const torch::Tensor& origin, const torch::Tensor& direction, const torch::Tensor& near,
                      const torch::Tensor& far, const FieldImageOptions& options = {});

}  // namespace doppel
